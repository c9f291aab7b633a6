"""The DBC file, read by canmatrix, which knows nothing of the code that packs the frames.

check_dbc.py signals DBC               one line for each signal, one for each value text
check_dbc.py encode DBC SEED COUNT     random frames, whether they are to be taken, and their values
check_dbc.py decode DBC FILE           compares frames with the values that their packer was given
check_dbc.py page DBC                  the tables of CAN.md
"""
import binascii
import random
import sys
from decimal import ROUND_HALF_EVEN, Decimal

import canmatrix.formats

BITRATE = 500_000


def raw_range(signal):
    """The codes of known values: whole numbers of steps between the DBC's least and greatest."""
    def code(value):
        return int(((Decimal(value) - signal.offset) / signal.factor).to_integral(ROUND_HALF_EVEN))
    return code(signal.min), code(signal.max)


def absent(signal):
    """The code that means that nothing is known: the one with a text, outside the range."""
    low, high = raw_range(signal)
    codes = [raw for raw in signal.values if not low <= raw <= high]
    assert len(codes) <= 1, signal.name
    return codes[0] if codes else None


def guarded(frame):
    return frame.signal_by_name("Crc16") is not None


def payload(frame):
    return [signal for signal in frame.signals if signal.name not in ("Crc16", "Counter")]


def crc(identifier, data):
    return binascii.crc_hqx(bytes(data[2:8]) + identifier.to_bytes(2, "little"), 0xFFFF)


def signals(matrix):
    for frame in matrix.frames:
        for signal in payload(frame):
            low, high = raw_range(signal)
            print("signal", frame.name, signal.name, float(signal.raw2phys(low)),
                  float(signal.raw2phys(high)), float(signal.factor))
            for raw, text in signal.values.items():
                print("text", frame.name, signal.name, raw, text)


def any_code(signal):
    lowest = -(1 << signal.size - 1) if signal.is_signed else 0
    return random.randrange(lowest, lowest + (1 << signal.size))


def random_code(signal):
    """Mostly a code that is allowed, its ends often; now and then any code at all."""
    low, high = raw_range(signal)
    choice = random.random()
    if choice < 0.02:
        return any_code(signal)
    if choice < 0.12:
        return random.choice([low, high])
    if choice < 0.22 and absent(signal) is not None:
        return absent(signal)
    return random.randint(low, high)


def encode(matrix, seed, count):
    random.seed(seed)
    for k in range(count):
        frame = matrix.frames[k % len(matrix.frames)]
        codes = {signal.name: random_code(signal) for signal in frame.signals}
        data = frame.signals_to_bytes(codes)
        if guarded(frame):
            data[0:2] = crc(frame.arbitration_id.id, data).to_bytes(2, "little")
        values, taken = [], True
        for signal in payload(frame):
            code = codes[signal.name]
            low, high = raw_range(signal)
            if code == absent(signal):
                values.append(f"{signal.name}=-")
                continue
            taken = taken and low <= code <= high
            values.append(f"{signal.name}={float(signal.raw2phys(code))!r}")
        print(frame.name, frame.arbitration_id.id, data.hex(), "taken" if taken else "refused",
              *values)


def decode(matrix, path):
    by_id = {frame.arbitration_id.id: frame for frame in matrix.frames}
    frames = values = 0
    seen = set()
    for line in open(path, encoding="ascii"):
        identifier, text, *given = line.split()
        frame, data = by_id[int(identifier)], bytes.fromhex(text)
        decoded = frame.decode(data)
        if guarded(frame):
            assert decoded["Crc16"].raw_value == crc(int(identifier), data), line
        names = set()
        for name, value in (pair.split("=") for pair in given):
            signal, raw = frame.signal_by_name(name), decoded[name].raw_value
            low, high = raw_range(signal)
            names.add(name)
            values += 1
            if value == "-":
                assert raw == absent(signal), (name, raw, line)
                continue
            assert low <= raw <= high, (name, raw, line)
            # Half a step, and single precision: a scaled value may be rounded to the other side.
            wrong = abs(float(signal.raw2phys(raw)) - float(value)) / float(signal.factor)
            assert wrong <= 0.5 + abs(raw) * 2.0 ** -22, (name, raw, line)
        assert names == {signal.name for signal in payload(frame)}, line
        frames += 1
        seen.add(frame.name)
    assert len(seen) == len(matrix.frames), seen
    print(f"compared {frames} frames, {values} values, {len(seen)} messages")


def stuffed_bits(length):
    """Start to the third bit of the pause, with a stuff bit wherever the frame could need one."""
    return 47 + 8 * length + (34 + 8 * length - 1) // 4


def number(value):
    return f"{float(value):.10g}"


def meaning(signal):
    parts = []
    low, high = raw_range(signal)
    if signal.size == 1:
        return f"0 {signal.values[0]}, 1 {signal.values[1]}"
    scale = number(signal.factor)
    if signal.name.startswith(("Voltage", "Current")):
        scale = "1/8191"
    unit = "" if signal.unit in ("", "1") else f" {signal.unit}"
    if scale != "1" or unit:
        parts.append(f"x {scale}{unit}" + (f" + {number(signal.offset)}" if signal.offset else ""))
    parts.append(f"{number(signal.raw2phys(low))} to {number(signal.raw2phys(high))}{unit}")
    if absent(signal) is not None:
        parts.append(f"code {absent(signal)}: {signal.values[absent(signal)]}")
    return "; ".join(parts)


def place(signal):
    first = signal.start_bit
    last = first + signal.size - 1
    def bit(n):
        return f"{n // 8}.{n % 8}"
    return bit(first) if signal.size == 1 else f"{bit(first)} to {bit(last)}"


def page_frames(matrix):
    print("| frame | identifier | bytes | cycle | from | guarded |")
    print("|---|---|---|---|---|---|")
    for frame in matrix.frames:
        cycle = f"{frame.cycle_time} ms" if frame.cycle_time else "event"
        print(f"| {frame.name} | 0x{frame.arbitration_id.id - 1:03X} + N | {frame.size} | {cycle} | "
              f"{frame.transmitters[0]} | {'yes' if guarded(frame) else ''} |")


def page_signals(matrix):
    for frame in matrix.frames:
        print(f"\n### {frame.name}, 0x{frame.arbitration_id.id - 1:03X} + N\n")
        print(frame.comment + "\n")
        print("| signal | byte.bit | bits | value | |")
        print("|---|---|---|---|---|")
        for signal in sorted(frame.signals, key=lambda signal: signal.start_bit):
            kind = f"{signal.size}{' signed' if signal.is_signed else ''}"
            print(f"| {signal.name} | {place(signal)} | {kind} | {meaning(signal)} | "
                  f"{signal.comment} |")
        for signal in payload(frame):
            texts = {raw: text for raw, text in signal.values.items() if raw != absent(signal)}
            if signal.size > 1 and texts:
                print(f"\n{signal.name}: " + ", ".join(f"{raw} {text}"
                                                       for raw, text in sorted(texts.items())))


def page_load(matrix):
    print("\n## Load of the bus\n")
    print(f"At {BITRATE // 1000} kbit/s, each frame with all the stuff bits it could need.\n")
    print("| frame | bits | frames a second | load |")
    print("|---|---|---|---|")
    total = 0.0
    for frame in matrix.frames:
        if not frame.cycle_time:
            continue
        bits, rate = stuffed_bits(frame.size), 1000 / frame.cycle_time
        load = 100 * bits * rate / BITRATE
        total += load
        print(f"| {frame.name} | {bits} | {number(rate)} | {load:.2f} % |")
    print(f"| all | | | {total:.2f} % |")
    sampling = sum(100 * stuffed_bits(8) * 1000 / BITRATE
                   for frame in matrix.frames if frame.transmitters[0] == "Acquisition")
    print(f"\nWithout an acquisition node on the bus: {total - sampling:.2f} %.")


def main(mode, dbc, *rest):
    matrix = canmatrix.formats.loadp_flat(dbc)
    if mode == "signals":
        signals(matrix)
    elif mode == "encode":
        encode(matrix, int(rest[0]), int(rest[1]))
    elif mode == "decode":
        decode(matrix, rest[0])
    elif mode == "page":
        page_frames(matrix)
        page_signals(matrix)
        page_load(matrix)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(*sys.argv[1:])
