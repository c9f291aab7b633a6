"""run_structured_text.py PAGE FRAMES: the function GuardCrc of the page, run on each frame.

Structured Text is brought into Python statement by statement: just what the function uses.
"""
import re
import sys


def translated(text):
    body = text[text.rindex("END_VAR") + len("END_VAR"):
                text.index("END_FUNCTION")]
    body = re.sub(r"\(\*.*?\*\)", "", body, flags=re.S)
    body = re.sub(r"16#([0-9A-F]+)", r"0x\1", body)
    lines, depth = [], 1
    for line in filter(None, (line.strip() for line in body.splitlines())):
        if line.startswith(("END_", "ELSE", "ELSIF")):
            depth -= 1
        if line.startswith("END_"):
            continue
        loop = re.fullmatch(r"FOR (\w+) := (\d+) TO (\d+) DO", line)
        branch = re.fullmatch(r"(IF|ELSIF) (.*) THEN", line)
        if loop:
            lines.append("  " * depth + f"for {loop[1]} in range({loop[2]}, {loop[3]} + 1):")
        elif branch:
            condition = re.sub(r"(?<![<>:])=", "==", branch[2]).replace("<>", "!=")
            keyword = "if" if branch[1] == "IF" else "elif"
            lines.append("  " * depth + f"{keyword} {condition.replace('AND', '&')}:")
        elif line == "ELSE":
            lines.append("  " * depth + "else:")
        else:
            target, value = re.fullmatch(r"(\w+) := (.*);", line).groups()
            value = value.replace("XOR", "^").replace("AND", "&")
            lines.append("  " * depth + f"{target} = {value}")
            continue
        depth += 1
    return "def guard(Data, Id):\n  Crc = 0xFFFF\n" + "\n".join(lines) + "\n  return GuardCrc\n"


def main(page, frames):
    text = open(page, encoding="utf-8").read()
    source = text[text.index("FUNCTION GuardCrc"):]
    assert "Crc : WORD := 16#FFFF;" in source
    names = {"SHL": lambda word, bits: word << bits & 0xFFFF, "SHR": lambda word, bits: word >> bits,
             "BYTE_TO_WORD": lambda byte: byte, "WORD_TO_BYTE": lambda word: word & 0xFF}
    exec(translated(source), names)
    count = 0
    for line in open(frames, encoding="ascii"):
        identifier, data = line.split()
        data = bytes.fromhex(data)
        assert names["guard"](data, int(identifier)) == data[0] | data[1] << 8, line
        count += 1
    print(count, "frames")


main(*sys.argv[1:])
