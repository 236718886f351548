"""The doctor over 20 good recordings and 69 spoilt in 23 ways: each fault named with its remedy, none invented.

`python -m pytest -m slow -n 0 -s tests/evaluation/test_doctor_study.py` prints the table; it takes some minutes.
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import drawn
import numpy as np
import pytest
from spoilt_recordings import FAULTS, Fault

from odom.evaluation.diagnosis import Finding, Recording, Verdict, examine
from odom.service.source_sample import collect
from sensors.catalogue import open_source
from sensors.source import SourceOptions

SECONDS = 6.0
EACH = 3
"""Recordings that each fault is put into."""
_FOCAL = re.compile(r"fits (\d+) ± (\d+) and (\d+) ± (\d+)")
_SCALE = re.compile(r"([\d.]+) ± ([\d.]+) \(95 %\) of the truth's")


def look(spec: str, start: float, seed: int = 1) -> Recording:
    options = SourceOptions(start=start, seed=seed)
    source = open_source(spec, options)
    try:
        return collect(source.messages(), options.topics, SECONDS, lambda done: None, source.lossless)
    finally:
        source.close()


def good_recordings(shared_data: Path) -> Iterator[tuple[str, Recording]]:
    """Yield 20 stretches: 7 of a slow walk at a desk, 3 of quick turns, 10 of five simulated walks."""
    for start in range(0, 21, 3):
        yield f"fr1_xyz from {start} s", look(str(shared_data / "tum_fr1_xyz"), start)
    for start in (0.0, 1.0, 2.0):
        yield f"fr1_rpy from {start:.0f} s", look(str(shared_data / "tum_fr1_rpy_part"), start)
    for seed in range(1, 6):
        for start in (4.0, 14.0):
            yield f"arena {seed} from {start:.0f} s", look("arena", start, seed)


def can_show(fault: Fault, found: list[Finding], name: str) -> bool:
    """Whether a recording says enough, unspoilt, for the checks that this fault concerns."""
    verdicts = {finding.key: finding for finding in found}
    good = all(key not in verdicts or verdicts[key].verdict is Verdict.GOOD for key in fault.keys)
    return good and (not fault.by_truth or bool(_SCALE.search(verdicts["depth scale"].value)))


def wrong_verdicts(fault: Fault, found: list[Finding]) -> str:
    """Return what is wrong with the findings, empty when the fault is named, with its remedy, and nothing else is."""
    bad = {finding.key: finding for finding in found if finding.verdict is Verdict.BAD}
    missed, invented = fault.keys - bad.keys(), bad.keys() - fault.keys
    words = [f"missed {key}" for key in sorted(missed)]
    words += [f"invented {key} ({bad[key].value})" for key in sorted(invented)]
    named = " ".join(finding.advice for key, finding in bad.items() if key in fault.keys)
    if not missed and fault.keys and fault.remedy not in named:
        words.append(f"the remedy does not say {fault.remedy!r}")
    return "; ".join(words)


def covered(found: list[Finding], true: Recording, scale: float) -> list[bool]:
    """Return for each 95 % interval that is given whether it holds the true value."""
    out = []
    assert true.camera is not None
    for finding in found:
        if numbers := _FOCAL.search(finding.value):
            fx, dx, fy, dy = map(float, numbers.groups())
            out += [abs(fx - true.camera.fx) <= dx, abs(fy - true.camera.fy) <= dy]
        elif numbers := _SCALE.search(finding.value):
            ratio, off = map(float, numbers.groups())
            out.append(abs(ratio - scale) <= off)
    return out


@pytest.mark.slow
@pytest.mark.rendered
@pytest.mark.timeout(1800)
def test_faults_are_named_none_is_invented_and_intervals_hold(
    shared_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sensors.arena.source.frame", drawn.frame)
    wrong, intervals, told = [], [], Counter[str]()
    bases = [(name, recording, examine(recording)) for name, recording in good_recordings(shared_data)]
    nothing = Fault(lambda recording, rng: recording, frozenset(), "")
    cases = [("nothing", nothing, base) for base in bases]
    for number, (name, fault) in enumerate(FAULTS.items()):
        fit = [base for base in bases if can_show(fault, base[2], base[0])]
        cases += [(name, fault, fit[(number + k * len(fit) // EACH) % len(fit)]) for k in range(EACH)]
    for number, (name, fault, (source, recording, found)) in enumerate(cases):
        if fault is not nothing:
            found = examine(fault.spoil(recording, np.random.default_rng(number)))
        intervals += covered(found, recording, fault.scale)
        why = wrong_verdicts(fault, found)
        told[name] += not why
        wrong += [f"{name} in {source}: {why}"] if why else []
    for name, count in told.items():
        print(f"{name:<30} {count} of {sum(case[0] == name for case in cases)}")
    print(f"95 % intervals                 {sum(intervals)} of {len(intervals)} hold the true value")
    print("\n".join(wrong))
    assert len(cases) >= 80
    assert wrong == []
    assert np.mean(intervals) >= 0.95
