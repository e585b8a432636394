"""A reader of report pages: tables, sections, numbers, and what the page loads."""

from html.parser import HTMLParser


class Reader(HTMLParser):
    """Cells of the tables by id, sections, numbers in them, what the page loads; and whether all is closed."""

    void = frozenset({"meta", "link", "br", "img", "hr", "input", "wbr", "circle", "line", "rect", "polyline"})

    def __init__(self):
        super().__init__()
        self.open, self.loads, self.tables, self.table = [], [], {}, None
        self.sections, self.exact, self.text = [], {}, {}

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.loads += [v for k, v in attrs if k in ("src", "href", "xlink:href") and not v.startswith("#")]
        if tag not in self.void:
            self.open.append(tag)
        if tag == "section":
            self.sections.append(attributes["id"])
        if tag == "table":
            self.table = self.tables.setdefault(attributes.get("id"), [])
        if tag == "tr":
            self.table.append([])
        if tag in ("td", "th"):
            self.table[-1].append("")
        if tag == "data":
            self.exact.setdefault(self.sections[-1], []).append(float(attributes["value"]))

    def handle_endtag(self, tag):
        if tag not in self.void:
            assert self.open.pop() == tag

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.void:
            self.open.pop()

    def handle_data(self, text):
        if self.open and {"td", "th"} & set(self.open):
            self.table[-1][-1] += text
        if self.sections and "script" not in self.open:
            self.text[self.sections[-1]] = self.text.get(self.sections[-1], "") + text


def read(html):
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader
