"""Opens pages in a real browser and looks: python3 tests/pages/check.py [--pictures FOLDER] PAGE.html...

Of each page: nothing is written to the console as an error, no address but the page is asked for, every picture is drawn
with its series, names from files stand as they are, the page is as wide as the window, values can be read and zoomed;
on a desktop and on a phone, light and dark. With --pictures, screenshots and the printed page are kept to be looked at."""

import argparse
import pathlib

from browser import Browser

LARGEST = 6_000_000
WINDOWS = {"desktop": (1280, 900), "phone": (390, 844)}

# Pictures of groups that are not folded away; none of them may be empty.
VISIBLE = "[...document.querySelectorAll('[data-plot]')].filter((p) => p.querySelector('.drawing').clientWidth)"
DRAWN = f"""{VISIBLE}.every((p) => {{
    const drawing = p.querySelector('.drawing');
    return drawing.querySelector('.main-svg') && drawing.data.length > 0 && drawing.querySelector('.trace, .bars .point, .scatterlayer .trace');
}})"""
COUNT = f"{VISIBLE}.length"
SERIES = f"{VISIBLE}.map((p) => p.querySelector('.drawing').data.length)"
TOO_WIDE = """(() => {
    const wide = [...document.querySelectorAll('main *')].filter((e) => !e.closest('.scroll') && e.getBoundingClientRect().right > innerWidth + 1);
    return document.documentElement.scrollWidth > innerWidth ? wide.slice(0, 3).map((e) => e.outerHTML.slice(0, 120)) : [];
})()"""
# Names of channels that are drawn must be texts, not elements.
FOREIGN = "document.querySelectorAll('.drawing script, .drawing img, .drawing a, .drawing iframe').length"
# The middle of the first picture that can be zoomed along its horizontal axis.
PLACE = """(() => {
    const box = document.querySelector('.drawing:has(.scatterlayer .trace)');
    if (!box) return null;
    box.scrollIntoView({block: 'center', behavior: 'instant'});
    const area = box.querySelector('.nsewdrag').getBoundingClientRect();
    return [area.x, area.y, area.width, area.height];
})()"""
RANGE = "document.querySelector('.drawing:has(.scatterlayer .trace)').layout.xaxis.range.join(' ')"
HOVERED = "document.querySelectorAll('.hoverlayer text').length > 0"


def wrong(browser, page):
    """What the browser complains of, and addresses that it asked for."""
    found = []
    for event in browser.events:
        method, about = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = about["exceptionDetails"]
            found.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning", "assert"):
            found.append(" ".join(str(a.get("value", a.get("description"))) for a in about["args"]))
        elif method == "Log.entryAdded" and about["entry"]["level"] == "error":
            found.append(about["entry"]["text"])
        elif method == "Page.javascriptDialogOpening":
            found.append(f"a dialog opened: {about['message']}")
        elif method == "Network.requestWillBeSent":
            url = about["request"]["url"]
            if url != page.as_uri() and not url.startswith(("data:", "blob:")):
                found.append(f"asked for {url}")
    return found


def reads_and_zooms(browser):
    """A pointer in a picture shows values; dragging across it changes what it shows."""
    place = browser.run(PLACE)
    if place is None:
        return []
    x, y, width, height = place
    middle = y + height / 2
    found = []
    before = browser.run(RANGE)
    browser.mouse("mouseMoved", x + 0.4 * width, middle)
    browser.mouse("mouseMoved", x + 0.5 * width, middle)
    try:
        browser.wait(HOVERED)
    except RuntimeError:
        found.append("no values are shown under the pointer")
    held = {"button": "left", "buttons": 1}
    browser.mouse("mouseMoved", x + 0.3 * width, middle)
    browser.mouse("mousePressed", x + 0.3 * width, middle, clickCount=1, **held)
    for share in (0.4, 0.5, 0.6):
        browser.mouse("mouseMoved", x + share * width, middle, **held)
    browser.mouse("mouseReleased", x + 0.6 * width, middle, clickCount=1, **held)
    try:
        browser.wait(f"{RANGE} !== '{before}'")
    except RuntimeError:
        found.append("dragging across a picture does not zoom")
    return found


def check(browser, page, pictures):
    """Sentences on what is wrong with a page."""
    found = []
    if (size := page.stat().st_size) > LARGEST:
        found.append(f"{size} bytes")
    count = None
    for window, (width, height) in WINDOWS.items():
        for dark in (False, True):
            name = f"{page.stem}-{window}-{'dark' if dark else 'light'}"
            browser.look(width, height, dark)
            browser.open(page)
            try:
                browser.wait(DRAWN)
            except RuntimeError:
                found.append(f"{name}: pictures that are not drawn")
            count = browser.run(COUNT)
            if not count and not page.stem.startswith("empty"):
                found.append(f"{name}: no pictures")
            if 0 in browser.run(SERIES):
                found.append(f"{name}: a picture without series")
            found += [f"{name}: wider than the window: {e}" for e in browser.run(TOO_WIDE)]
            if browser.run(FOREIGN):
                found.append(f"{name}: a text became an element")
            if pictures:
                browser.screenshot(pictures / f"{name}.png")
            if window == "desktop" and not dark:
                found += [f"{name}: {problem}" for problem in reads_and_zooms(browser)]
            found += [f"{name}: {problem}" for problem in wrong(browser, page)]
    browser.look(*WINDOWS["desktop"], True)
    browser.open(page)
    browser.wait(DRAWN)
    if pictures:
        browser.paper(pictures / f"{page.stem}.pdf")
    print(f"{page.name}: {count} pictures, {size / 1e6:.2f} MB, {'; '.join(found) or 'all well'}")
    return found


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("pages", nargs="+", type=pathlib.Path)
    arguments.add_argument("--pictures", type=pathlib.Path)
    given = arguments.parse_args()
    if given.pictures:
        given.pictures.mkdir(parents=True, exist_ok=True)
    with Browser() as browser:
        found = [check(browser, page.resolve(), given.pictures) for page in given.pages]
    raise SystemExit(any(found))


if __name__ == "__main__":
    main()
