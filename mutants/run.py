"""Mutants of identify, covariance and explain, and which test kills each.

    python3 mutants/run.py [--percent 4] [--seed 101] [--limit 30] [--only survivors.txt] [--work target/mutants]

Draws a share of all replacements (innovant-mutants), writes them behind switches into a clone of HEAD, builds the tests once,
notes which test meets which mutant, and asks for each mutant the tests that meet it, from cheap to dear, up to LIMIT seconds.
Prints what survived, and writes `results.tsv` and `survivors.txt` (keys, for --only) into the work folder. Two tests run side
by side, on one thread each. Takes half an hour for 300 mutants with a limit of 30 seconds on two cores.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
FOLDERS = ("src/identify", "src/covariance", "src/explain")
# They kill processes and fill disks: nothing of what is mutated.
LEFT_OUT = ("faults", "limits")
# Tests that take less are asked together, up to so many seconds.
CHEAP, TOGETHER = 1.5, 6.0


def sh(*command, **how):
    return subprocess.run(command, text=True, capture_output=True, **how)


class Tree:
    """A clone with mutants in it, and its tests."""

    def __init__(self, work):
        self.work = work
        self.root = work / "tree"
        self.environment = os.environ | {
            "CARGO_MANIFEST_DIR": str(self.root),
            "RAYON_NUM_THREADS": "1",
        }

    def write(self, percent, seed, only, refused):
        shutil.rmtree(self.root, ignore_errors=True)
        sh("git", "clone", "-q", str(ROOT), str(self.root), check=True)
        shared, link = ROOT.parent / "shared", self.work / "shared"
        if shared.exists() and not link.exists():
            link.symlink_to(shared)
        tracked = sh("git", "ls-files", *FOLDERS, cwd=self.root, check=True).stdout.split()
        files = [f for f in tracked if f.endswith(".rs") and not re.search("tests|fixtures|reference", f)]
        keys = only
        environment = dict(os.environ)
        if only or refused:
            if not only:
                keys = self.keys() - refused
            (self.work / "only.txt").write_text("\n".join(sorted(keys - refused)))
            environment["INNOVANT_MUTANTS_ONLY"] = str(self.work / "only.txt")
        tool = ["cargo", "run", "-q", "--release", "--manifest-path", str(HERE / "Cargo.toml")]
        tool += ["--target-dir", str(self.work / "tool"), "--"]
        made = sh(*tool, str(self.root), str(percent), str(seed), str(self.work / "sites.tsv"), *files, env=environment)
        print((made.stdout + made.stderr).strip(), flush=True)
        made.check_returncode()
        shutil.copy(HERE / "src/switch.rs", self.root / "src/mutant.rs")
        with open(self.root / "src/lib.rs", "a") as library:
            library.write("#[allow(missing_docs)]\nmod mutant;\n")

    def sites(self):
        lines = (self.work / "sites.tsv").read_text().splitlines()
        return {int(n): (place, what, key) for n, place, what, key in (line.split("\t", 3) for line in lines)}

    def keys(self):
        return {key for _, _, key in self.sites().values()}

    def build(self):
        """The test programs, or the keys of mutants that do not compile."""
        environment = os.environ | {"CARGO_TARGET_DIR": str(self.work / "target")}
        command = ["cargo", "test", "--no-run", "--lib", "--tests", "--message-format=short"]
        built = sh(*command, cwd=self.root, env=environment)
        if built.returncode:
            places = set(re.findall(r"^(src/[^:]+:\d+):\d+: error", built.stderr, re.M))
            refused = {key for place, _, key in self.sites().values() if place in places}
            if not refused:
                raise SystemExit(built.stderr[-4000:])
            return None, refused
        programs = {}
        for name, path in re.findall(r"Executable (?:unittests )?(\S+) \((.*)\)", built.stderr):
            name = name.removeprefix("tests/").removesuffix("/main.rs").removesuffix(".rs")
            if name not in LEFT_OUT:
                programs[name] = str((self.root / path).resolve())
        return programs, set()

    def run(self, program, tests, limit, **switches):
        command = [program, "--exact", "--test-threads=1", *tests]
        how = {"cwd": self.root, "env": self.environment | switches, "start_new_session": True}
        out = subprocess.PIPE
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, **how)
        try:
            text, _ = process.communicate(timeout=limit)
            return process.returncode == 0, text.decode(errors="replace")
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            return False, "longer than it may take"

    def met(self, programs):
        """For each test its seconds and the mutants that it meets."""
        tests = []
        for name, program in programs.items():
            listed = sh(program, "--list", "--format", "terse", cwd=self.root, env=self.environment).stdout
            tests += [(name, line[:-6]) for line in listed.splitlines() if line.endswith(": test")]

        def ask(index):
            name, test = tests[index]
            note = self.work / f"met_{index}.txt"
            note.unlink(missing_ok=True)
            begun = time.monotonic()
            passed, text = self.run(programs[name], [test], 600, INNOVANT_MET=str(note))
            seconds = time.monotonic() - begun
            if not passed:
                print(f"fails without a mutant, left out: {name} {test}: {text[-300:]}", flush=True)
                return None
            numbers = set(map(int, note.read_text().split())) if note.exists() else set()
            note.unlink(missing_ok=True)
            return name, test, seconds, numbers

        with ThreadPoolExecutor(2) as two:
            return [found for found in two.map(ask, range(len(tests))) if found]


def groups_of(number, met):
    """Tests that meet a mutant, cheap ones of a program together: (seconds, program, tests), cheap first."""
    groups, cheap = [], {}
    for name, test, seconds, numbers in met:
        if number in numbers:
            if seconds < CHEAP:
                cheap.setdefault(name, []).append((seconds, test))
            else:
                groups.append((seconds, name, [test]))
    for name, tests in cheap.items():
        together, sum_ = [], 0.0
        for seconds, test in tests:
            together.append(test)
            sum_ += seconds
            if sum_ > TOGETHER:
                groups.append((sum_, name, together))
                together, sum_ = [], 0.0
        if together:
            groups.append((sum_, name, together))
    return sorted(groups)


def ask(number, tree, programs, met, limit):
    groups = groups_of(number, met)
    if not groups:
        return "no test meets it"
    spent, whole = 0.0, sum(seconds for seconds, _, _ in groups)
    for seconds, name, tests in groups:
        if spent + seconds > limit:
            return f"survived {spent:.0f} of {whole:.0f} s"
        spent += seconds
        passed, text = tree.run(programs[name], tests, 6 * seconds + 15, INNOVANT_MUTANT=str(number))
        if not passed:
            failed = re.search(r"test (\S+) \.\.\. FAILED", text)
            return f"killed by {name} {failed.group(1) if failed else text[-60:]!r}"
    return f"survived all {whole:.0f} s"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--percent", type=float, default=4)
    parser.add_argument("--seed", type=int, default=101)
    parser.add_argument("--limit", type=float, default=30)
    parser.add_argument("--only", type=Path)
    parser.add_argument("--work", type=Path, default=ROOT / "target/mutants")
    asked = parser.parse_args()
    asked.work.mkdir(parents=True, exist_ok=True)
    tree = Tree(asked.work.resolve())
    only = set(asked.only.read_text().splitlines()) if asked.only else set()
    programs, refused = None, set()
    while programs is None:
        tree.write(asked.percent, asked.seed, only, refused)
        programs, more = tree.build()
        refused |= more
    met = tree.met(programs)
    (tree.work / "met.json").write_text(json.dumps([(n, t, s, sorted(m)) for n, t, s, m in met]))
    sites = tree.sites()
    results = {}
    with open(tree.work / "results.tsv", "w") as table, ThreadPoolExecutor(2) as two:

        def one(number):
            place, what, key = sites[number]
            results[number] = said = ask(number, tree, programs, met, asked.limit)
            table.write(f"{place}\t{what}\t{said}\t{key}\n")
            table.flush()

        list(two.map(one, sites))
    left = [number for number in sites if not results[number].startswith("killed")]
    (tree.work / "survivors.txt").write_text("".join(sites[n][2] + "\n" for n in left))
    print(f"{len(sites) - len(left)} of {len(sites)} killed, {len(refused)} did not compile; left:")
    for number in left:
        print(*sites[number][:2], results[number])


if __name__ == "__main__":
    main()
