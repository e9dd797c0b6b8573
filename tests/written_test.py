"""Man pages and completion that the program writes know every command, option and word of its help,
and the help is in plain words.

    written_test.py PROGRAM
"""

import functools
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = sys.argv.pop(1) if len(sys.argv) > 1 else "build/dev/pencilscan"


def run(*arguments, text=None):
    done = subprocess.run(arguments, input=text, capture_output=True, text=True)
    assert done.returncode == 0, f"{arguments}: {done.stderr}"
    return done.stdout


@functools.cache
def help_of(path):
    return run(PROGRAM, *path, "--help")


def commands_below(path):
    listed = help_of(path).partition("\nCommands:\n")[2].partition("\n\n")[0]
    return re.findall(r"^  (\S+)", listed, re.MULTILINE)


def all_commands(path=()):
    yield path
    for name in commands_below(path):
        yield from all_commands((*path, name))


def options_of(path):
    return re.findall(r"^  (?:-\w,)?(--[\w-]+)", help_of(path), re.MULTILINE)


def bash_offers(script, *words):
    """What Tab offers behind these words."""
    quoted = " ".join(f"'{word}'" for word in words)
    lines = f"{script}\nCOMP_WORDS=({quoted})\nCOMP_CWORD={len(words) - 1}\n_pencilscan\nprintf '%s\\n' \"${{COMPREPLY[@]}}\""
    return run("bash", "--norc", "-s", text=lines).split()


COMMANDS = list(all_commands())


class Written(unittest.TestCase):
    def test_every_command_has_a_man_page_with_its_options(self):
        self.assertGreater(len(COMMANDS), 20)
        with tempfile.TemporaryDirectory() as folder:
            run(PROGRAM, "manual", folder)
            names = {"-".join(("pencilscan", *path)) + ".1": path for path in COMMANDS}
            self.assertEqual(set(names), {file.name for file in Path(folder).iterdir()})
            for name, path in names.items():
                page = (Path(folder) / name).read_text()
                plain = page.replace("\\-", "-")
                self.assertRegex(page, r"^\.TH \S+ 1 ")
                self.assertRegex(plain, r"\.SH NAME\n" + name[:-2] + r" \\?- ?\S")
                for option in options_of(path):
                    self.assertIn(option, plain, name)
                for below in commands_below(path):
                    self.assertIn(f"{name[:-2]}-{below} (1)", plain)
                if shutil.which("groff"):
                    done = subprocess.run(["groff", "-man", "-Tutf8", "-ww", "-z"], input=page,
                                          capture_output=True, text=True)
                    self.assertEqual(done.stderr, "", name)

    def test_bash_completes_commands_options_and_words(self):
        script = run(PROGRAM, "completion", "bash")
        for path in COMMANDS:
            self.assertEqual(sorted(bash_offers(script, "pencilscan", *path, "--")), sorted(options_of(path)))
            for below in commands_below(path):
                self.assertIn(below, bash_offers(script, "pencilscan", *path, below[:1]))
        offers = bash_offers(script, "pencilscan", "reconstruct", "--method", "")
        self.assertEqual(offers, ["linear", "multiview", "joint", "single-projector"])
        self.assertEqual(bash_offers(script, "pencilscan", "reconstruct", "--method", "=", "jo"), ["joint"])
        self.assertEqual(bash_offers(script, "pencilscan", "simulate", "--up", "=" ), ["x", "y", "z"])
        self.assertEqual(bash_offers(script, "pencilscan", "rig", "ring", "--cameras", ""), [])
        self.assertEqual(bash_offers(script, "pencilscan", "rig", "check", "--rig", ""), [])  # readline's files

    def test_zsh_knows_commands_options_and_words(self):
        script = run(PROGRAM, "completion", "zsh")
        for path in COMMANDS:
            name = "_".join(("_pencilscan", *path))
            body = script.partition(f"\n{name}() {{\n")[2].partition("\n}\n")[0]
            for word in commands_below(path):
                self.assertIn(f"'{word}:", body)
                self.assertIn(f"{word}) {name}_{word} ;;", body)
            for option in options_of(path):
                self.assertIn(option, body)
        self.assertIn(":word:(linear multiview joint single-projector)", script)
        if shutil.which("zsh"):
            run("zsh", "-n", "-s", text=script)

    def test_help_is_in_plain_words_with_an_example(self):
        for path in COMMANDS[1:]:
            self.assertIn("Example:\n", help_of(path), path)
            for jargon in ("INT", "FLOAT", "ENUM", "UINT", " in [", " in {", "->", "SUBCOMMAND", "REQUIRED", "Needs:"):
                self.assertNotIn(jargon, help_of(path), path)

    def test_version_has_a_short_option(self):
        self.assertRegex(run(PROGRAM, "-V"), "^pencilscan ")
        self.assertEqual(run(PROGRAM, "-V"), run(PROGRAM, "--version"))

    def test_help_does_not_list_them(self):
        self.assertNotIn("completion", help_of(()))
        self.assertNotIn("manual", help_of(()))


if __name__ == "__main__":
    unittest.main()
