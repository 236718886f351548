"""The paper's synthetic benchmark, beside what is physically possible and what the paper prints."""
