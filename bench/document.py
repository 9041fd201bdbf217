"""Tables that scripts keep between the markers of a document."""


def rewrite(document, name, text):
    """Puts `text` between <!-- name:begin --> and <!-- name:end -->; ValueError if they are missing."""
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    whole = document.read_text()
    head, tail = whole.index(begin) + len(begin), whole.index(end)
    document.write_text(whole[:head] + "\n" + text + "\n" + whole[tail:])
