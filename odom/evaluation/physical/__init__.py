"""The paper's physical experiment: pairs of clouds of a camera on a walk, three front-ends, five estimators."""
