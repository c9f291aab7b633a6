// replaced by the first control block
