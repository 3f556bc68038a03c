"""The root of all errors that a user can mend."""


class UserError(Exception):
    """Something cannot be done; the message is one line that says what to do. A command ends with it and exit code 2."""
