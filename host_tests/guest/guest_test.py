"""The emulated board does what a test of the service will rely on."""

import struct
import unittest

from guest import Guest, QemuError, boot

SCAN = struct.Struct("<8hq")
CHANGE = struct.Struct("<QII")
ADC = "/sys/bus/iio/devices/iio:device0"


def can_up(guest):
    for name in ("can0", "can1"):
        guest.run(f"ip link set {name} up type can bitrate 500000")


class AGuestEnds(unittest.TestCase):
    def test_with_what_its_script_printed(self):
        self.assertIn("6.1.0", boot("uname -r; uname -v", can=0)[0])
        self.assertTrue(any("PREEMPT_RT" in line for line in boot("uname -v", can=0)))

    def test_with_an_error_if_its_script_fails(self):
        with self.assertRaisesRegex(QemuError, "(?s)status 3.*what went wrong"):
            boot("echo what went wrong; exit 3", can=0)

    def test_with_an_error_if_the_kernel_panics(self):
        with self.assertRaisesRegex(QemuError, "the guest has ended"):
            boot("echo c > /proc/sysrq-trigger; sleep 60", can=0)

    def test_with_an_error_if_the_watchdog_resets_it(self):
        with self.assertRaisesRegex(QemuError, "the guest has ended"):
            boot("echo 1 > /dev/watchdog0; sleep 3600", can=0, icount=True)

    def test_with_an_error_when_time_is_up(self):
        with Guest(can=0) as guest:
            guest.deadline = 0
            with self.assertRaisesRegex(QemuError, "time is up"):
                guest.run("sleep 3600")


class AGuestRuns(unittest.TestCase):
    def test_lines_of_shell_one_by_one(self):
        with Guest(files={"/etc/note": b"from here\n"}, can=0, ports=["plant"]) as guest:
            self.assertEqual(guest.run("cat /etc/note"), ["from here"])
            with self.assertRaisesRegex(QemuError, "(?s)status 1.*nothing like it"):
                guest.run("echo nothing like it; false")
            guest.run("exit_status() { return 7; }; exit_status", check=False)
            self.assertEqual(guest.status, 7)

            (guest.share / "note").write_text("shared", encoding="ascii")
            guest.run("cat /share/note /share/note > /share/answer")
            self.assertEqual((guest.share / "answer").read_text(encoding="ascii"), "sharedshared")

            guest.start("head -n 1 < /dev/virtio-ports/plant > /share/heard")
            guest.port("plant").write(b"over the port\n")
            guest.run("wait")
            self.assertEqual((guest.share / "heard").read_text(encoding="ascii"), "over the port\n")
            self.assertEqual(guest.finish(), 0)

    def test_the_same_instructions_each_time_it_counts_them(self):
        # Not from power on: while a device of this machine is waited for, the guest's time runs on.
        count = "read a _ < /proc/uptime; i=0; while [ $i -lt 30000 ]; do i=$((i+1)); done; "
        script = count + "read b _ < /proc/uptime; echo $a $b"
        taken = []
        for _ in range(2):
            begin_s, end_s = boot(script, can=0, icount=True)[0].split()
            taken.append(float(end_s) - float(begin_s))
        self.assertGreater(taken[0], 0.1)
        self.assertAlmostEqual(taken[0], taken[1], delta=0.05)


class TheCanBus(unittest.TestCase):
    def test_carries_frames_both_ways(self):
        with Guest() as guest:
            can_up(guest)
            for here, there in (("can0", "can1"), ("can1", "can0")):
                guest.run(f"listen -L -n 2 {there} > /tmp/{there}")
                guest.run(f"cansend {here} 123#DEADBEEF; cansend {here} 1FFFFFFF#01")
                guest.run("wait $listening")
                heard = [line.split()[1:] for line in guest.run(f"cat /tmp/{there}")]
                self.assertEqual(heard, [[there, "123#DEADBEEF"], [there, "1FFFFFFF#01"]])


class ThePins(unittest.TestCase):
    def test_of_pl061_are_read_and_driven_from_outside(self):
        with Guest(can=0) as guest:
            guest.run("gpioset gpiochip0 0=1 1=0 2=1 4=1 6=1 7=1")
            self.assertEqual(guest.line_levels() & 0xD7, 0xD5)
            self.assertEqual(guest.line_outputs() & 0xD7, 0xD7)
            for level in (1, 0, 1):
                guest.drive_line(5, level)
                self.assertEqual(guest.run("gpioget gpiochip0 5"), [str(level)])

    def test_of_pl061_are_traced_in_the_order_they_are_written(self):
        with Guest(can=0, trace="pl061_write") as guest:
            guest.run("gpioset gpiochip0 0=1 1=1 2=1")
            guest.finish()
            data = [line for line in guest.trace_file.read_text().splitlines() if "write" in line]
            self.assertGreater(len(data), 3)

    def test_of_the_bench_change_one_by_one_and_are_logged(self):
        with Guest(can=0) as guest:
            lines = " ".join(f"{line}={0xA5 >> line & 1}" for line in range(8))
            guest.run(f"gpioset cutforce-bench {lines} 8=1")
            guest.run("dd if=/dev/cutforce_gpio_log of=/share/log bs=4096 count=1 2> /dev/null")
            log = list(CHANGE.iter_unpack((guest.share / "log").read_bytes()))
            self.assertEqual([change[1:] for change in log], [(0, 1), (2, 1), (5, 1), (7, 1), (8, 1)])
            times = [change[0] for change in log]
            self.assertEqual(times, sorted(set(times)))
            guest.run("dd if=/dev/cutforce_gpio of=/share/levels bs=2 count=1 2> /dev/null")
            self.assertEqual((guest.share / "levels").read_bytes(), b"\xa5\x01")

    def test_of_the_bench_are_driven_by_the_world_where_they_are_inputs(self):
        with Guest(can=0) as guest:
            guest.run("gpioset cutforce-bench 0=0 1=1")
            guest.run(r"printf '\001\202' > /dev/cutforce_gpio")
            self.assertEqual(guest.run("gpioget cutforce-bench 9 8 15"), ["1 0 1"])
            guest.run("dd if=/dev/cutforce_gpio of=/share/levels bs=2 count=1 2> /dev/null")
            self.assertEqual((guest.share / "levels").read_bytes(), b"\x02\x82")


class TheConverter(unittest.TestCase):
    SCANS = [(k, -k, 32767, -32768, 5, 6, 7, 8, 10**9 + 125_000 * k) for k in range(64)]

    def write(self, guest):
        written = b"".join(SCAN.pack(*scan) for scan in self.SCANS)
        (guest.share / "scans").write_bytes(written)
        guest.run(f"dd if=/share/scans of=/dev/cutforce_adc bs={len(written)} 2> /dev/null")
        return written

    def enable(self, guest, channels, length):
        for channel in channels:
            guest.run(f"echo 1 > {ADC}/scan_elements/in_{channel}_en")
        guest.run(f"echo {length} > {ADC}/buffer/length && echo 1 > {ADC}/buffer/enable")

    def test_gives_whole_scans_to_its_reader(self):
        voltages = [f"voltage{number}" for number in range(6)]
        with Guest(can=0) as guest:
            self.assertEqual(guest.run(f"cat {ADC}/name"), ["cutforce-adc"])
            self.enable(guest, [*voltages, "anglvel", "power", "timestamp"], 128)
            written = self.write(guest)
            guest.run(f"dd if=/dev/iio:device0 of=/share/read bs=24 count={len(self.SCANS)} 2> /dev/null")
            self.assertEqual((guest.share / "read").read_bytes(), written)

    def test_gives_the_channels_that_are_wanted(self):
        with Guest(can=0) as guest:
            self.enable(guest, ["voltage1", "power", "timestamp"], 128)
            self.write(guest)
            guest.run(f"dd if=/dev/iio:device0 of=/share/read bs=16 count={len(self.SCANS)} 2> /dev/null")
            read = list(struct.iter_unpack("<2h4xq", (guest.share / "read").read_bytes()))
            self.assertEqual(read, [(scan[1], scan[7], scan[8]) for scan in self.SCANS])

    def test_loses_scans_that_nobody_reads_and_counts_them(self):
        lost = "/sys/module/cutforce_bench/parameters/scans_lost"
        with Guest(can=0) as guest:
            self.write(guest)
            self.assertEqual(guest.run(f"cat {lost}"), ["0"])  # nobody listened
            self.assertEqual(guest.run(f"cat {ADC}/in_voltage2_raw"), ["32767"])
            self.enable(guest, ["voltage0", "timestamp"], 16)
            self.write(guest)
            self.assertGreaterEqual(int(guest.run(f"cat {lost}")[0]), 32)

    def test_has_a_scale_that_a_test_chooses(self):
        with Guest(can=0) as guest:
            guest.run(f"echo 0.152587890 > {ADC}/in_voltage_scale; echo -17 > {ADC}/in_power_offset")
            self.assertEqual(guest.run(f"cat {ADC}/in_voltage_scale"), ["0.152587890"])
            self.assertEqual(guest.run(f"cat {ADC}/in_power_offset"), ["-17"])
            self.assertEqual(guest.run(f"cat {ADC}/in_anglvel_scale"), ["0.001000000"])


if __name__ == "__main__":
    unittest.main()
