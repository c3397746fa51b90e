"""What a laboratory adds to hsdsl: a method, a lint rule, an export target, a peer and a metric."""
