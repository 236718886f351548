"""`python -m odom`: the `odom` command of this very interpreter."""

from odom.cli import main

if __name__ == "__main__":
    main()
