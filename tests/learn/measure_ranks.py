#!/usr/bin/env python3
"""What several ranks of dpr learn train achieve, measured on one machine; no part of the tests, for it takes minutes.

measure_ranks.py kills DPR [TIMES]        kills a rank of two at random moments: errors, times, and the losses in the end
measure_ranks.py throughput DPR [BATCH [RATE]]  one rank on a core against two in network namespaces, a core each; the link
                                          at most as fast as RATE, such as 1gbit (root)
measure_ranks.py bytes DPR [BATCH]        bytes a step at a namespace's interface (root)
"""
import os
import pathlib
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "POCL_MAX_PTHREAD_COUNT": "1", "DPR_DEVICE": "cpu"}
NAMESPACES = ("dpr-measure-0", "dpr-measure-1")
PARAMETERS = 30_829_542  # of the network with 16 palette colours
CHANNELS = 64 + 128 + 256  # that are normalised


def make_data(dpr, folder):
    subprocess.run([dpr, "learn", "data", "-o", "data", "--classes", "sofa,car", "--train", "16", "--val", "1", "--test", "1",
                    "--quiet"], cwd=folder, check=True)


def command(dpr, run, steps, batch, *more):
    return [dpr, "learn", "train", "--data", "data", "--classes", "sofa,car", "-o", run, "--steps", str(steps), "--batch",
            str(batch), *more]


def measure_kills(dpr, folder, times):
    generator = random.Random(1)

    def words(run):
        return command(dpr, run, 9, 4, "--checkpoint-every", "3", "--ranks", "2", "--quiet")

    start = time.time()
    subprocess.run(words("undisturbed"), cwd=folder, check=True)
    undisturbed = time.time() - start
    expected = (folder / "undisturbed/losses.csv").read_text()
    failures, slowest, killed, restarted = [], 0, 0, 0
    while killed < times:
        run = f"run{killed}"
        process = subprocess.Popen(words(run), cwd=folder, stderr=subprocess.PIPE, text=True)
        time.sleep(generator.random() * undisturbed)
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        if len(children) < 2:
            process.wait()
            continue
        os.kill(int(generator.choice(children)), signal.SIGKILL)
        death = time.time()
        error = process.communicate()[1]
        slowest = max(slowest, time.time() - death)
        killed += 1
        if process.returncode != 1 or error.count("\n") != 1 or not error.startswith("dpr: error: "):
            failures.append(error)
        restarted += (folder / run / "checkpoint.pt").exists()
        subprocess.run(words(run), cwd=folder, check=True)
        if (folder / run / "losses.csv").read_text() != expected:
            failures.append(f"{run}: other losses")
        subprocess.run(["rm", "-r", run], cwd=folder, check=True)
    print(f"{killed} killed, {restarted} of them after a checkpoint; at most {slowest:.1f} s to the error; failures: {failures}")


def make_network():
    first, second = NAMESPACES
    for line in (f"netns add {first}", f"netns add {second}",
                 f"-n {first} link add dpr0 type veth peer name dpr1 netns {second}",
                 f"-n {first} address add 10.213.8.1/24 dev dpr0", f"-n {second} address add 10.213.8.2/24 dev dpr1",
                 f"-n {first} link set dpr0 up", f"-n {second} link set dpr1 up",
                 f"-n {first} link set lo up", f"-n {second} link set lo up"):
        subprocess.run(["ip", *line.split()], check=True)


def delete_network():
    for name in NAMESPACES:
        subprocess.run(["ip", "netns", "delete", name], check=False, stderr=subprocess.DEVNULL)


def limit_rate(rate):
    for rank, name in enumerate(NAMESPACES):
        subprocess.run(["tc", "-n", name, "qdisc", "replace", "dev", f"dpr{rank}", "root", "tbf", "rate", rate,
                        "burst", "1mb", "latency", "50ms"], check=True)


def counted_bytes():
    counters = "/sys/class/net/dpr0/statistics/"
    words = ["ip", "netns", "exec", NAMESPACES[0], "cat", counters + "tx_bytes", counters + "rx_bytes"]
    return [int(number) for number in subprocess.run(words, check=True, capture_output=True).stdout.split()]


def train(dpr, folder, ranks, steps, batch):
    """Trains, and returns when rank 0 told that a step is done: with ten of them it does so for each."""
    with socket.socket() as free:
        free.bind(("", 0))
        port = free.getsockname()[1]
    subprocess.run(["rm", "-rf", "run"], cwd=folder, check=True)
    processes = []
    for rank in range(ranks):
        words = ["taskset", "-c", str(rank), *command(dpr, "run", steps, batch, "--checkpoint-every", "100000")]
        variables = dict(os.environ, **ONE_THREAD)
        if ranks > 1:
            words = ["ip", "netns", "exec", NAMESPACES[rank], *words]
            variables.update(RANK=str(rank), WORLD_SIZE=str(ranks), MASTER_ADDR="10.213.8.1", MASTER_PORT=str(port))
        processes.append(subprocess.Popen(words, cwd=folder, env=variables, stdout=subprocess.PIPE, text=True))
    times = [time.time() for line in processes[0].stdout if f"/{steps} " in line]
    for process in processes:
        if process.wait() != 0:
            sys.exit("a rank failed")
    return times


def seconds_a_step(dpr, folder, ranks, batch):
    """Median and minimum of nine: other work on the machine makes a step longer, never shorter."""
    times = train(dpr, folder, ranks, 10, batch)
    steps = [after - before for before, after in zip(times, times[1:])]
    return statistics.median(steps), min(steps)


def measure_throughput(dpr, folder, batch):
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    one, two = (seconds_a_step(dpr, folder, ranks, batch) for ranks in (1, 2))
    for what, a, b in zip(("median", "minimum"), one, two):
        print(f"batch {batch}, {what} of nine steps: one rank {a:.3f} s, two ranks {b:.3f} s, {a / b:.2f} times the throughput")
    print(f"load after: {os.getloadavg()[0]:.1f}")


def measure_bytes(dpr, folder, batch):
    def of_run(steps):
        before = counted_bytes()
        train(dpr, folder, 2, steps, batch)
        return [after - first for after, first in zip(counted_bytes(), before)]

    few, many = 2, 10
    sent, received = ((b - a) / (many - few) for a, b in zip(of_run(few), of_run(many)))
    formula = 2 * (2 - 1) / 2 * (4 * PARAMETERS + 2 * 2 * 8 * CHANNELS + 4 * 8)
    print(f"a step sends {sent:.0f} and receives {received:.0f} bytes; the formula says {formula:.0f}: "
          f"{100 * (sent / formula - 1):+.2f}% and {100 * (received / formula - 1):+.2f}%")


def main():
    what, dpr = sys.argv[1], str(pathlib.Path(sys.argv[2]).resolve())
    number = int(sys.argv[3]) if len(sys.argv) > 3 else {"kills": 20, "throughput": 256, "bytes": 4}[what]
    measure = {"kills": measure_kills, "throughput": measure_throughput, "bytes": measure_bytes}[what]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        make_data(dpr, folder)
        if what == "kills":
            measure(dpr, folder, number)
            return
        try:
            make_network()
            if len(sys.argv) > 4:
                limit_rate(sys.argv[4])
            measure(dpr, folder, number)
        finally:
            delete_network()


if __name__ == "__main__":
    main()
