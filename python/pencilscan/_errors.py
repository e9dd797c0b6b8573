"""What can go wrong. The compiled part raises these."""


class InputError(ValueError):
    """Input that breaks a rule; its text is one line: file: field = value: rule.

    Attributes
    ----------
    file : str
        The file, argument or option at fault.
    field : str
        Where inside it; may be empty.
    value : str
        What stands there; may be empty.
    rule : str
        What must hold.
    """

    def __init__(self, file: str, field: str, value: str, rule: str) -> None:
        self.file = file
        self.field = field
        self.value = value
        self.rule = rule
        place = " = ".join(part for part in (field, value) if part)
        super().__init__(": ".join(part for part in (file, place, rule) if part))

    def __reduce__(self):
        return InputError, (self.file, self.field, self.value, self.rule)


class StageError(RuntimeError):
    """A stage that could not produce its result: no line was found, the disk is full."""


class Cancelled(RuntimeError):
    """The `progress` function returned False."""
