#!/usr/bin/env python3
"""Compares the emulated core with Unicorn, instruction by instruction, on random encodings and states.

Not part of the test command: Unicorn is under the GPL. Prepare and run with
    pip install unicorn==2.1.4
    cargo build --release -p emulator --example instructions
    tools/emulator/against_unicorn.py target/release/examples/instructions 1000000 [seed]
Every difference is printed; the exit status is 1 if there is one that is not explained (docs/emulator-check.md).
"""

import collections
import random
import struct
import subprocess
import sys
import threading

from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, UcError
from unicorn import arm_const as arm

CODE, DATA = 0x08000000, 0x20001000
# What a pattern's letters stand for: registers that most instructions may have; x is any bit. Registers r0 to r12, r14.
REGISTERS = [*range(13), 14]

# Name, pattern, what the base register n needs (see `base`), groups by file of the decoder.
PATTERNS = [
    # Narrow.
    ("shift imm", "000ttxxxxxmmmddd"), ("add/sub reg", "000110xmmmnnnddd"), ("add/sub imm3", "000111xmmmnnnddd"),
    ("mov/cmp/add/sub imm8", "001xxdddxxxxxxxx"), ("data processing", "010000xxxxmmmddd"), ("add high", "01000100xmmmmddd"),
    ("cmp high", "01000101xmmmmddd"), ("mov high", "01000110xmmmmddd"), ("bx", "010001110mmmm000"), ("blx", "010001111mmmm000"),
    ("adr", "10100dddxxxxxxxx"), ("add sp", "10101dddxxxxxxxx"), ("sp imm", "10110000xxxxxxxx"), ("cbz", "1011x0x1xxxxxddd"),
    ("extend", "10110010xxmmmddd"), ("rev", "10111010xxmmmddd"), ("b cond", "1101xxxxxxxxxxxx"), ("b", "11100xxxxxxxxxxx"),
    # Data processing.
    ("dp imm", "11110x0xxxxxnnnn0xxxddddxxxxxxxx"), ("dp imm test", "11110x0xxxx1nnnn0xxx1111xxxxxxxx"),
    ("mov/mvn imm", "11110x0001xx11110xxxddddxxxxxxxx"), ("plain imm", "11110x1xxxx0nnnn0xxxddddxxxxxxxx"),
    ("bit field", "11110011xxx0nnnn0xxxddddxx0xxxxx"), ("bfc", "1111001101101111 0xxxddddxx0xxxxx"),
    ("dp reg", "1110101xxxxxnnnn0xxxddddxxxxmmmm"), ("dp reg test", "1110101xxxx1nnnn0xxx1111xxxxmmmm"),
    ("mov/mvn reg", "1110101001xx11110xxxddddxxxxmmmm"), ("shift reg", "111110100xxxnnnn1111dddd0000mmmm"),
    ("extend add", "111110100xxxnnnn1111dddd1xxxmmmm"), ("extend", "111110100xxx11111111dddd1xxxmmmm"),
    # SIMD.
    ("parallel", "111110101xxxnnnn1111dddd0xxxmmmm"), ("saturating", "111110101000nnnn1111dddd10xxmmmm"),
    ("rev/clz", "1111101010x1mmmm1111dddd10xxmmmm"), ("sel", "111110101010nnnn1111dddd1000mmmm"), ("pkh", "111010101100nnnn0xxxddddxxx0mmmm"),
    ("ssat/usat", "111100111xx0nnnn0xxxddddxx0xxxxx"), ("ssat", "1111001100x0nnnn0xxxddddxx0xxxxx"),
    # Multiply.
    ("multiply", "111110110xxxnnnnaaaadddd00xxmmmm"), ("multiply, no addend", "111110110xxxnnnn1111dddd00xxmmmm"),
    ("long", "111110111xxxnnnnaaaaddddxxxxmmmm"), ("mull/mlal", "1111101111xx0nnnaaaadddd0000mmmm"),
    ("smlal halves", "111110111100nnnnaaaadddd10xxmmmm"), ("smlald", "11111011110xnnnnaaaadddd110xmmmm"),
    ("umaal", "111110111110nnnnaaaadddd0110mmmm"), ("divide", "1111101110x1nnnn1111dddd1111mmmm"),
    # Branches and special registers.
    ("b cond wide", "111100xxxx0000xx10000xxxxxxxxxxx"), ("b cond wide", "111101xxxx1111xx10101xxxxxxxxxxx"),
    ("b wide", "1111000000000xxx10111xxxxxxxxxxx"), ("b wide", "1111011111111xxx10111xxxxxxxxxxx"), ("bl", "1111000000000xxx11111xxxxxxxxxxx"),
    ("bl", "1111011111111xxx11111xxxxxxxxxxx"),
    ("mrs apsr", "11110011111011111000dddd00000000"), ("msr apsr", "111100111000nnnn1000xx0000000000"),
    # Floating point.
    ("vfp three", "111011100xxxxxxxxxxx1010xxx0xxxx"), ("vdiv", "111011101x00xxxxxxxx1010x0x0xxxx"), ("vfma", "111011101xxxxxxxxxxx1010xxx0xxxx"),
    ("vmov imm", "111011101x11xxxxxxxx10100000xxxx"), ("vmov/vabs/vneg/vsqrt", "111011101x11000xxxxx1010x1x0xxxx"),
    ("vcvt half", "111011101x11001xxxxx1010x1x0xxxx"), ("vcmp", "111011101x11010xxxxx1010x1x0xxxx"), ("vcvt int", "111011101x11110xxxxx1010x1x0xxxx"),
    ("vcvt from int", "111011101x111000xxxx1010x1x0xxxx"), ("vcvt fixed", "111011101x111x1xxxxx1010x1x0xxxx"),
    ("vmov core", "11101110000xxxxxdddd1010x0010000"), ("vmov scalar", "1110111000xx0xxxdddd10110x010000"),
    ("vmov two", "11101100010xnnnndddd101x00x1xxxx"), ("vmrs", "1110111011110001dddd101000010000"), ("vmrs apsr", "11101110111100011111101000010000"),
    ("vmsr", "1110111011100001dddd101000010000"),
]
# Loads and stores; `n` is given an address such that the access falls into the window.
MEMORY = [
    ("ls reg", "0101xxxmmmnnnddd", "register"), ("ls imm5 word", "0110xiiiiinnnddd", "i4"), ("ls imm5 byte", "0111xiiiiinnnddd", "i1"),
    ("ls imm5 half", "1000xiiiiinnnddd", "i2"), ("ls sp", "1001xdddiiiiiiii", "sp"), ("push", "1011010xxxxxxxxx", "sp"),
    ("pop", "10111100xxxxxxxx", "sp"), ("ldm/stm", "1100xnnnxxxxxxxx", "middle"), ("ldm/stm wide", "1110100xx0xxnnnn0x0xxxxxxxxxxxxx", "middle"),
    ("ldrd/strd", "1110100xx1xxnnnnaaaaddddiiiiiiii", "i4u"), ("ls imm12", "11111000 1xxxnnnnddddiiiiiiiiiiii", "i1"),
    ("ls imm12 signed", "11111001 10x1nnnnddddiiiiiiiiiiii", "i1"), ("ls imm8", "1111100x0xxxnnnndddd1xxxiiiiiiii", "i1u"),
    ("ls reg wide", "1111100x0xxxnnnndddd000000xxmmmm", "register2"), ("ldrex", "111010000101nnnndddd1111iiiiiiii", "i4"),
    ("strex", "111010000100nnnnaaaaddddiiiiiiii", "i4"), ("strexb/h", "111010001100nnnnaaaa1111010xdddd", "middle"),
    ("ldrexb/h", "111010001101nnnndddd1111010x1111", "middle"), ("tbb", "111010001101nnnn11110000000xmmmm", "register"),
    ("vldr/vstr", "11101101xx0xnnnnxxxx101xiiiiiiii", "i4u"), ("vldm/vstm", "1110110xxxxxnnnnxxxx101x000xxxxx", "middle"),
]


class Generator:
    def __init__(self, seed):
        self.random = random.Random(seed)
        patterns = [(*pattern, None) for pattern in PATTERNS] + MEMORY
        self.patterns = [(name, pattern.replace(" ", ""), base) for name, pattern, base in patterns]

    def word(self):
        r = self.random
        kind = r.randrange(8)
        if kind == 0:
            return r.choice([0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFF7FFF, 0x80008000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF])
        if kind == 1:
            return r.randrange(64)
        return r.getrandbits(32)

    def float(self):
        r = self.random
        kind = r.randrange(10)
        if kind == 0:
            special = [0, 1, 0x7FFFFF, 0x800000, 0x3F800000, 0x7F7FFFFF, 0x7F800000, 0x7FC00000, 0x7F800001, 0x7FC12345, 0x7FA12345]
            return r.choice(special) | r.getrandbits(1) << 31
        if kind < 4:
            return r.getrandbits(32)
        # Of magnitudes that meet.
        return r.getrandbits(1) << 31 | (127 + r.randrange(-16, 40)) << 23 | r.getrandbits(23)

    def encode(self, pattern):
        fields = {}
        value = 0
        counts = collections.Counter(pattern)
        chosen = {}
        for letter in "dnma":
            width = min(counts[letter], 4)
            if width:
                chosen[letter] = self.random.choice(REGISTERS) if width == 4 else self.random.randrange(8)
        seen = collections.Counter()
        for letter in pattern:
            value <<= 1
            if letter in "01":
                value |= int(letter)
            elif letter in chosen:
                width = min(counts[letter], 4)
                value |= chosen[letter] >> (width - 1 - seen[letter] % width) & 1
                seen[letter] += 1
            else:
                bit = self.random.getrandbits(1)
                value |= bit
                if letter == "i":
                    fields["i"] = fields.get("i", 0) << 1 | bit
        return value, chosen, fields

    def case(self, address):
        r = self.random
        name, pattern, base = r.choice(self.patterns)
        encoding, chosen, fields = self.encode(pattern)
        if name == "b cond" and encoding >> 8 == 0xDF:
            encoding ^= 0x200  # A supervisor call is no branch.
        if name == "shift imm" and encoding >> 11 == 3:
            encoding &= 0x17FF
        registers = [self.word() for _ in range(15)]
        registers[13] = DATA + 128
        middle = DATA + r.randrange(96, 160) & ~3
        if r.randrange(8) == 0 and base in ("i1", "i2", "register", "register2", "i1u"):
            middle += r.randrange(4)
        offset = fields.get("i", 0)
        if base == "sp":
            registers[13] = DATA + 128 - (4 * offset if name == "ls sp" else 0)
        elif base in ("register", "register2") and chosen["n"] != chosen["m"]:
            shift = encoding >> 4 & 3 if base == "register2" else 0
            index = r.randrange(16)
            registers[chosen["m"]] = index
            registers[chosen["n"]] = (middle - (index << shift)) & 0xFFFFFFFF
        elif base == "middle":
            registers[chosen["n"]] = middle
        elif base in ("i1", "i2", "i4"):
            registers[chosen["n"]] = (middle - int(base[1]) * offset) & 0xFFFFFFFF
        elif base in ("i1u", "i4u"):
            # Where the bits for direction and order decide: most of these fall into the window.
            scale = int(base[1])
            up = encoding >> (23 if base == "i4u" else 9) & 1
            before = encoding >> (24 if base == "i4u" else 10) & 1
            signed = scale * offset if up else -scale * offset
            registers[chosen["n"]] = (middle - (signed if before else 0)) & 0xFFFFFFFF
        if name in ("bx", "blx"):
            target = CODE + 0x1000 + 2 * r.randrange(0x1000) | 1
            registers[chosen["m"]] = target
        if name in ("add high", "mov high") and encoding & 0x87 == 0x87:
            # To the program counter.
            target = CODE + 0x1000 + 2 * r.randrange(0x1000)
            registers[encoding >> 3 & 15] = target if name == "mov high" else (target - address - 4) & 0xFFFFFFFF
        steps = 1
        if len(pattern) == 16:
            halves = [encoding]
            if r.randrange(4) == 0 and name not in ("bx", "blx", "cbz", "b cond", "b"):
                # In an IT block.
                condition = r.randrange(14)
                halves = [0xBF08 | condition << 4, encoding]
                steps = 2
        else:
            halves = [encoding >> 16, encoding & 0xFFFF]
            if name == "strex" and r.randrange(4):
                # Behind its load, into a register of its own: otherwise it stores nothing.
                loaded = next(n for n in (0, 1, 2, 3) if n not in chosen.values())
                halves = [halves[0] | 0x10, loaded << 12 | 0xF00 | encoding & 0xFF, *halves]
                steps = 2
            elif name == "strexb/h" and r.randrange(4):
                loaded = next(n for n in (0, 1, 2, 3) if n not in chosen.values())
                halves = [halves[0] | 0x10, loaded << 12 | 0xF4F | encoding & 0x10, *halves]
                steps = 2
        halves += [0xBF00] * (4 - len(halves))
        code = struct.pack("<4H", *halves)
        status = r.getrandbits(5) << 27
        if name in ("parallel", "sel", "mrs apsr", "msr apsr"):
            status |= r.getrandbits(4) << 16
        modes = r.choice([0, 0, 0, 0x10, 0x10, r.getrandbits(5) << 22]) | r.getrandbits(4) << 28
        floats = [self.float() for _ in range(32)]
        memory = [self.word() for _ in range(64)]
        if name == "tbb":
            memory = [r.getrandbits(32) & 0x0F0F0F0F for _ in range(64)]
        return name, address, steps, code, registers, status, modes, floats, memory


class Reference:
    """Unicorn's Cortex-M4."""

    def __init__(self):
        self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.uc.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M4)
        self.uc.mem_map(CODE, 0x80000)
        self.uc.mem_map(DATA - 0x1000, 0x2000)
        # msr apsr_nzcvqg, r0; clrex
        self.uc.mem_write(CODE + 0x7F000, struct.pack("<4H", 0xF380, 0x8C00, 0xF3BF, 0x8F2F))
        # vmov.f32 s0, s0: the first use of the unit makes a new context.
        self.uc.mem_write(CODE + 0x7F100, struct.pack("<2H", 0xEEB0, 0x0A40))
        self.uc.emu_start(CODE + 0x7F100 | 1, 0, count=1)
        core = [getattr(arm, f"UC_ARM_REG_R{n}") for n in range(13)] + [arm.UC_ARM_REG_SP, arm.UC_ARM_REG_LR]
        floats = [getattr(arm, f"UC_ARM_REG_S{n}") for n in range(32)]
        self.written = [*core, arm.UC_ARM_REG_FPSCR, *floats]
        self.read = [*core, arm.UC_ARM_REG_PC, arm.UC_ARM_REG_XPSR, arm.UC_ARM_REG_FPSCR, *floats]

    def run(self, case):
        _, address, steps, code, registers, status, modes, floats, memory = case
        uc = self.uc
        # The greater-or-equal flags can only be set by the instruction for them.
        uc.reg_write(arm.UC_ARM_REG_XPSR, 1 << 24)
        uc.reg_write(arm.UC_ARM_REG_R0, status)
        uc.emu_start(CODE + 0x7F000 | 1, 0, count=2)
        uc.reg_write_batch(list(zip(self.written, [*registers, modes, *floats])))
        uc.mem_write(DATA, struct.pack("<64I", *memory))
        try:
            # What an IT block skips is no instruction for Unicorn: there the end is an address.
            in_block = steps == 2 and code[1] == 0xBF
            uc.emu_start(address | 1, address + 4 if in_block else 0, count=steps)
        except UcError as error:
            return str(error), None
        return None, ([value & 0xFFFFFFFF for value in uc.reg_read_batch(self.read)], bytes(uc.mem_read(DATA, 256)))


NAMES = [*(f"r{n}" for n in range(13)), "sp", "lr", "pc", "xpsr", "fpscr", *(f"s{n}" for n in range(32))]


def differences(case, ours, theirs):
    (values, memory), (their_values, their_memory) = ours, theirs
    found = []
    for name, mine, other in zip(NAMES, values, their_values):
        if name == "xpsr":
            mine, other = mine & 0xF80F0000, other & 0xF80F0000
        if mine != other:
            found.append(f"{name} {mine:08x} not {other:08x}")
    if memory != their_memory:
        found.append("memory")
    return found


def explained(name, code, modes, found):
    """Differences that are Unicorn's, with the reason (docs/emulator-check.md)."""
    first, second = struct.unpack_from("<2H", code)
    if first & 0xFFBE == 0xEEBA and second & 0x0F40 == 0x0A40 and all(f[0] == "s" or f.startswith("fpscr") for f in found) and modes & 0xC00000:
        # The architecture rounds fixed point to nearest, whatever the mode; this version of Unicorn by the mode.
        return "rounds by the mode"
    if name in ("mov high", "add high") and all(f.startswith("sp ") for f in found):
        # Bits 1 and 0 of the stack pointer are always zero (B1.4.1); this version of Unicorn keeps them.
        return "bits of the stack pointer"
    if code[1] == 0xBF and len(found) == 1 and found[0].startswith("pc "):
        mine, other = (int(word, 16) for word in found[0][3:].split(" not "))
        if other == mine + 2 and mine % 16 == 4:
            # It did not count the skipped instruction and ran the NOP behind.
            return "counts otherwise"
    return None


def send(stream, batch):
    for _, address, steps, code, registers, status, modes, floats, memory in batch:
        words = [*registers, status, modes, *floats, *memory]
        stream.write(struct.pack("<2I", address, steps) + code + struct.pack(f"<{len(words)}I", *words))
    stream.flush()


def main():
    program, count = sys.argv[1], int(sys.argv[2])
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    generator, reference = Generator(seed), Reference()
    child = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    statistics = collections.defaultdict(collections.Counter)
    shown = collections.Counter()
    done = 0
    result_size = 4 * (1 + len(NAMES)) + 256
    while done < count:
        # As many as fit into the code before what was translated has to be forgotten.
        batch = [generator.case(CODE + 0x20000 + 16 * i) for i in range(min(4096, count - done))]
        for case in batch:
            name, address, steps, code, registers, status, modes, floats, memory = case
            reference.uc.mem_write(address, code)
        reference.uc.ctl_flush_tb()
        writer = threading.Thread(target=send, args=(child.stdin, batch))
        writer.start()
        for case in batch:
            name, address, steps, code, registers, status, modes, floats, memory = case
            raw = child.stdout.read(result_size)
            result = struct.unpack_from(f"<{1 + len(NAMES)}I", raw)
            if result[0] in (1, 2):
                statistics[name]["unpredictable" if result[0] == 1 else "unknown"] += 1
                continue
            error, theirs = reference.run(case)
            if result[0] == 3 or error:
                verdict = "both fault" if result[0] == 3 and error else "one faults"
                found = [f"status {result[0]}, {error}"] if verdict == "one faults" else []
            else:
                found = differences(case, (result[1:], raw[-256:]), theirs)
                verdict = "differs" if found else "same"
            reason = explained(name, code, modes, found) if found else None
            if reason:
                verdict = reason
            statistics[name][verdict] += 1
            if found and not reason:
                shown[name] += 1
                if shown[name] <= 4:
                    print(f"{name}: {code.hex(' ', 2)} status {status:08x} fpscr {modes:08x}: {', '.join(found[:5])}", flush=True)
                    print("    r", " ".join(f"{r:08x}" for r in registers), "s", " ".join(f"{s:08x}" for s in floats) if "v" == name[0] else "")
        writer.join()
        done += len(batch)
    child.stdin.close()
    columns = sorted({verdict for counter in statistics.values() for verdict in counter})
    print("| group |", " | ".join(columns), "|")
    print("|---|", "---|" * len(columns), sep="")
    for name, counter in statistics.items():
        print(f"| {name} |", " | ".join(str(counter[column]) for column in columns), "|")
    totals = collections.Counter()
    for counter in statistics.values():
        totals.update(counter)
    print("| all |", " | ".join(str(totals[column]) for column in columns), "|")
    sys.exit(1 if shown else 0)


if __name__ == "__main__":
    main()
