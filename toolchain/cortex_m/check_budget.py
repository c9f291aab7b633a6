#!/usr/bin/env python3
"""check_budget.py BUDGET COUNTS: lines "name number" against those that were agreed on.

Fails, with a line for each, where a number has grown by more than 2 %, and where a name is in one of
the two only: what nobody counts any more has no budget, and what is new needs one.
"""
import sys

MOST = 1.02


def read(path):
    numbers = {}
    for text in open(path, encoding="utf-8"):
        fields = text.split("#")[0].split()
        if fields:
            name, number = fields
            numbers[name] = int(number)
    return numbers


def main():
    budget, counts = read(sys.argv[1]), read(sys.argv[2])
    if not budget or not counts:
        sys.exit("nothing to compare")
    wrong = [f"{name}: {counts[name]}, the budget is {agreed}"
             for name, agreed in budget.items() if name in counts and counts[name] > MOST * agreed]
    wrong += [f"{name}: {agreed} in the budget, and not counted" for name, agreed in budget.items()
              if name not in counts]
    wrong += [f"{name}: {count}, without a budget" for name, count in counts.items()
              if name not in budget]
    if wrong:
        print("\n".join(wrong))
        print("toolchain/cortex_m/count.sh > host_tests/cortex_m/budget.txt agrees to it, "
              "if this is meant")
        sys.exit(1)


main()
