"""The encoding of a text that is not UTF-8, by its bytes and by words of measurement."""

import re

ENCODINGS = {
    "cp932": "Shift-JIS",
    "gb18030": "GB 18030",
    "euc_kr": "EUC-KR",
    "big5": "Big5",
    "euc_jp": "EUC-JP",
    "cp1251": "Windows-1251",
    "koi8_r": "KOI8-R",
    "latin-1": "Latin-1",
}
"""Python's name of an encoding -> its usual name; the order breaks ties."""
WORDS = re.compile(
    r"時間|時刻|変位|荷重|静電容量|容量|温度|圧力|電圧|電流|深さ|力|秒|位置|"
    r"时间|位移|电容|压力|温度|电压|电流|深度|载荷|力|秒|位置|時間|位移|電容|壓力|電壓|荷載|"
    r"시간|변위|하중|정전용량|압력|온도|전압|깊이|위치|"
    r"время|перемещение|сила|ёмкость|емкость|давление|температура|напряжение|глубина|положение",
    re.IGNORECASE,
)
"""Words of measurement in the languages of these encodings."""
RUNS, HEAD = 0.75, 64 * 1024
"""Smallest share of bytes beyond ASCII next to another one in a text of no western language [1]; bytes of its head."""


def encoding_of(raw: bytes) -> tuple[str, bool]:
    """Return the encoding of a text that is not UTF-8, and whether it is a guess.

    In a western text bytes beyond ASCII stand alone, between letters. Where they stand in rows, the encoding in which
    most words of measurement appear is taken, else the first that has a character for each byte.
    """
    head = raw[:HEAD]
    beyond = re.findall(rb"[\x80-\xff]+", head)
    total = sum(map(len, beyond))
    in_rows = sum(len(run) for run in beyond if len(run) > 1)
    # Bytes of Shift-JIS may stand alone, too, so words of measurement count.
    words = [word for name in ("cp932", "gb18030") for word in WORDS.findall(head.decode(name, "ignore"))]
    if not total or (in_rows < RUNS * total and max(map(len, words), default=0) < 2):
        return "latin-1", False
    hits = {name: _hits(raw, name) for name in ENCODINGS if name != "latin-1"}
    best = max(hits, key=lambda name: hits[name])
    if hits[best] > 0:
        return best, False
    return next((name for name, count in hits.items() if count == 0), "latin-1"), True


def _hits(raw: bytes, name: str) -> int:
    """Return the number of letters in words of measurement; -1 if the encoding lacks a character."""
    try:
        text = raw.decode(name)
    except UnicodeDecodeError:
        return -1
    # Squared: a longer word is far less likely to appear in the wrong encoding by chance.
    return sum(len(word) ** 2 for word in WORDS.findall(text[:HEAD]))
