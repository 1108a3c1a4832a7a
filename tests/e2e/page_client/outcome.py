"""What a check found, in a line."""


class Failed(Exception):
    pass


def demand(condition, page_says, seen=""):
    if not condition:
        raise Failed(f"{page_says}\n        but: {seen}" if seen != "" else page_says)


def passed(what):
    print("ok     ", what, flush=True)


def skipped(what):
    print("skipped", what, flush=True)
