# SPDX-License-Identifier: BSD-2-Clause
"""What the package raises, besides the ValueError and KeyError that people expect."""


class DynacomError(Exception):
    """Base of the package's own errors.

    The message is one line, fit to be shown to whoever gave the input: it names the thing, what was
    expected and what was got.
    """

    def __init__(self, message: str) -> None:
        # Other libraries' messages, which ours may quote, can have more lines.
        super().__init__(" ".join(line.strip() for line in message.splitlines()))


class NotReadyError(DynacomError, RuntimeError):
    """Something was used before it was ready.

    A contact or a DynaCoM before ``initialize()``, a result before it was computed.
    """
