"""Make what tells whether the advice on the next record is any good."""
