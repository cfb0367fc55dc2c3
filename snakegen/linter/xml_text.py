"""Text of XML files as every parser should see it: whatever its encoding, blanks and prefixes.

Parsers of robot files differ: urdfdom and MuJoCo take bytes of any encoding and prefixes that
nobody declared, and refuse tabs in vectors; ElementTree and lxml do the opposite. Findings are made
of the text as it stands; readers get one that they all agree on.
"""

import codecs
import re
from pathlib import Path

from snakegen.base.bounded_text import read_bytes
from snakegen.linter.xml_tree import XmlFault, parse_xml

_BOMS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_PACKED = ((b"\x1f\x8b", "gzip"), (b"PK\x03\x04", "zip"), (b"BZh", "bzip2"), (b"\xfd7zXZ", "xz"))
_DECLARED = re.compile(rb"""^\s*<\?xml[^>]*\bencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_ENCODING = re.compile(r"""(^\s*<\?xml[^>]*\bencoding\s*=\s*)(["'])[^"']*\2""")
_PREFIX = re.compile(r"[<\s](?!xml(?:ns)?:)([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=[\s=/>])")
_DEFAULT = re.compile(r"""\sxmlns\s*=\s*("[^"]*"|'[^']*')""")
_QUOTED = re.compile(r"""(?<==)\s*("[^"<>]*[\t\n][^"<>]*"|'[^'<>]*[\t\n][^'<>]*')""")
_BLANKS = str.maketrans("\t\n", "  ")


def read_xml(path: Path, most: int) -> tuple[str, str]:
    """Returns the text of an XML file and the name of its encoding, empty where it is UTF-8.

    Args:
        path: a file, or a pipe that a shell made.
        most: bytes that are read.

    Raises:
        OSError: as `read_bounded`.
        ValueError: a compressed file, or text that its own encoding cannot have.
    """
    return decode_xml(read_bytes(path, most))


def decode_xml(data: bytes) -> tuple[str, str]:
    """Returns the text of XML and the name of its encoding, empty where it is UTF-8.

    The encoding is that of a byte order mark, UTF-8, the declared one, or ISO-8859-1.

    Raises:
        ValueError: compressed data, or text that its own encoding cannot have.
    """
    for magic, name in _PACKED:
        if data.startswith(magic):
            raise ValueError(f"the file is compressed ({name}); unpack it first")
    encoding = next((name for mark, name in _BOMS if data.startswith(mark)), "")
    if not encoding and data[:4] in (b"<\0?\0", b"<\0r\0", b"<\0m\0"):
        encoding = "utf-16-le"
    if not encoding:
        try:
            return _lines(data.decode("utf-8")), ""
        except UnicodeDecodeError:
            encoding = _declared(data)
    try:
        return _lines(data.decode(encoding)), encoding.upper()
    except UnicodeDecodeError as error:
        raise ValueError(f"its text is no {encoding.upper()}: {error.reason}") from None


def _declared(data: bytes) -> str:
    match = _DECLARED.match(data[:500])
    try:
        name = codecs.lookup(match[1].decode("ascii") if match else "iso-8859-1").name
    except LookupError:
        return "iso-8859-1"
    return "iso-8859-1" if name in ("utf-8", "ascii", "iso8859-1") else name


def _lines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def as_utf8(text: str) -> str:
    """Returns XML whose declaration, where it names an encoding, names UTF-8."""
    return _ENCODING.sub(r"\1\2UTF-8\2", text, count=1)


def conforming(text: str) -> str:
    """Returns XML that parsers with and without namespaces read alike.

    Line ends and tabs in attributes become blanks, as XML says; default namespaces are removed;
    prefixes that the root element does not declare are declared there. Text that needs none of it
    is returned as it is; malformed text too, for a parser to say so.
    """
    text = as_utf8(text)
    if _QUOTED.search(text):
        text = _QUOTED.sub(lambda match: match[0].translate(_BLANKS), text)
    if "xmlns" in text:
        text = _DEFAULT.sub("", text)
    used = set(_PREFIX.findall(text))
    if not used:
        return text
    try:
        root = parse_xml(text)
    except XmlFault:
        return text
    missing = sorted(p for p in used if f"xmlns:{p}" not in root.attrib)
    if not missing:
        return text
    at = root.start + 1 + len(root.tag.encode("utf-8"))
    data = text.removeprefix("\ufeff").encode("utf-8")
    names = "".join(f' xmlns:{p}="{p}"' for p in missing).encode("utf-8")
    return (data[:at] + names + data[at:]).decode("utf-8")
