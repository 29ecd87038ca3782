"""Names of months in several languages, as the English abbreviations that dates are read by."""

import re
import unicodedata

MONTHS = {
    "Jan": "january januar janner janvier enero gennaio janeiro januari ene gen",
    "Feb": "february februar fevrier febrero febbraio fevereiro februari fev fevr",
    "Mar": "march marz maerz mars marzo marco maart mrz",
    "Apr": "april avril abril aprile avr abr",
    "May": "mai mayo maggio maio mei mag",
    "Jun": "june juni juin junio giugno junho giu",
    "Jul": "july juli juillet julio luglio julho juil lug",
    "Aug": "august aout agosto augustus ago",
    "Sep": "september septembre septiembre settembre setembro sept set",
    "Oct": "october oktober octobre octubre ottobre outubro okt ott out",
    "Nov": "november novembre noviembre novembro",
    "Dec": "december dezember decembre diciembre dicembre dezembro dez dic",
}
"""English abbreviation -> names in German, French, Spanish, Italian, Portuguese and Dutch, without accents."""
ENGLISH = {name: month for month, names in MONTHS.items() for name in (month.lower(), *names.split())}
WORD = re.compile(r"[^\W\d_]{3,}\.?")


def in_english(text: str) -> str:
    """Return a date with English abbreviations in place of other names of months; other words stay."""
    bare = {w: unicodedata.normalize("NFD", w.lower()).encode("ascii", "ignore").decode() for w in WORD.findall(text)}
    return WORD.sub(lambda match: ENGLISH.get(bare[match[0]].rstrip("."), match[0]), text)
