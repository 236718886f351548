"""What only the paper's tables and the public interface need: KF, RF and the streaming filter, and their rivals."""
