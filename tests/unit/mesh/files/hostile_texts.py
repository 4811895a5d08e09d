"""Texts for which a naive search or parser takes quadratic time."""

TEXTS = {
    "word": "a" * 300_000,
    "blanks": "a" + " " * 300_000 + ".",
    "parts": "a." * 40_000 + "a = 1",
    "quoted parts": "'a'." * 40_000 + "a = 1",
    "quotes": "\"'" * 150_000,
    "table": "[" + "a." * 40_000 + "a]",
    "almost": ("a." * 49 + "a b ") * 3000,
    "deep": "a = " + "[" * 100_000,
}
DECKS = {
    r"line 2, \*NODE": "*NODE\n1, " + "12," * 30_000,
    r"line 1, \*NODE": "*NODE" + ",a=12" * 30_000,
    r"line 1, \*NODE:": "*NODE,\n" + ",\n" * 300_000,
    r"line 1, \*:": "12," * 30_000,
}
