#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What tests/bench/soak takes for growth, of series that are made by chance.

    check_soak.py SOAK"""
import importlib.machinery
import importlib.util
import random
import sys
import unittest

sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("soak", sys.argv.pop())
soak = importlib.util.module_from_spec(importlib.util.spec_from_loader("soak", LOADER))
LOADER.exec_module(soak)
TIMES = 100


def samples(minutes, mb, noise_mb, chance):
    """mb: of a minute."""
    return [(60 * m, 4 + mb(m) + chance.gauss(0, noise_mb)) for m in range(minutes)]


def steps(minutes, n, chance):
    """2.5 MB in n steps, of any height and at any time."""
    at = [chance.randrange(1, minutes) for _ in range(n)]
    high = [chance.random() for _ in range(n)]
    return lambda m: 2.5 * sum(h for a, h in zip(at, high) if m >= a) / sum(high)


def share_that_grows(series):
    def grows(one):
        middle, least, _ = soak.growth(soak.minutes(one))
        return middle > 1 and least > 0
    return sum(grows(one) for one in series) / TIMES


class Growth(unittest.TestCase):
    def setUp(self):
        self.chance = random.Random(1)

    def of_steps(self, minutes, n):
        return share_that_grows(samples(minutes, steps(minutes, n, self.chance), .03, self.chance)
                                for _ in range(TIMES))

    def of_a_leak(self, minutes, mb_an_hour, noise_mb):
        return share_that_grows(samples(minutes, lambda m: mb_an_hour * m / 60, noise_mb,
                                        self.chance) for _ in range(TIMES))

    def test_one_step_is_none(self):
        self.assertLess(self.of_steps(20, 1), .05)
        self.assertLess(self.of_steps(115, 1), .05)

    def test_two_steps_rarely_are(self):
        self.assertLess(self.of_steps(20, 2), .25)
        self.assertLess(self.of_steps(115, 2), .15)

    def test_what_does_not_grow_does_not(self):
        self.assertLess(self.of_a_leak(20, 0, .1), .05)
        self.assertLess(self.of_a_leak(115, 0, 1), .05)

    def test_a_leak_is_found_in_20_minutes(self):
        self.assertEqual(self.of_a_leak(20, 5, .02), 1)
        self.assertGreater(self.of_a_leak(20, 5, .1), .95)

    def test_a_slow_one_in_two_hours(self):
        self.assertEqual(self.of_a_leak(115, 1.5, .02), 1)
        self.assertGreater(self.of_a_leak(115, 1.5, .3), .9)


if __name__ == "__main__":
    unittest.main()
