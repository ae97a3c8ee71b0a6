"""Reads a page that `report` made, with the standard library's parser of HTML.

Checks that every element is closed, that ids are the same wherever they repeat, and that the page loads nothing. Prints
the numbers of headings, pictures and table rows, and the texts of headings, captions and cells.
"""

import sys
from html.parser import HTMLParser

VOID = {"meta", "path", "rect", "circle", "polyline", "line", "br"}
COUNTED = ("h2", "figure", "tr")
READ = ("h1", "h2", "figcaption", "td", "th", "p")


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.counts, self.texts, self.text = [], dict.fromkeys(COUNTED, 0), [], None

    def handle_startendtag(self, tag, attributes):
        self.check(attributes)

    def handle_starttag(self, tag, attributes):
        self.check(attributes)
        if tag not in VOID:
            self.open.append(tag)
        if tag in COUNTED:
            self.counts[tag] += 1
        if tag in READ:
            self.text = ""

    def check(self, attributes):
        for name, value in attributes:
            assert name not in ("src", "srcset", "href", "data") and "http" not in (value or "").replace(
                "http://www.w3.org/2000/svg", ""
            ), (name, value)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, (tag, self.open)
        if tag in READ and self.text is not None:
            self.texts.append(self.text)
            self.text = None

    def handle_data(self, data):
        if self.text is not None:
            self.text += data


with open(sys.argv[1], encoding="utf-8") as file:
    page = file.read()
assert "@import" not in page and "url(http" not in page and "<script" not in page
reader = Reader()
reader.feed(page)
reader.close()
assert not reader.open, reader.open
print(*reader.counts.values())
print("\n".join(reader.texts))
