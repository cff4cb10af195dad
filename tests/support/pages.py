"""What every report promises."""

import html
import re


def numbers_without_a_file(page: str) -> list[str]:
    """Sentences of a page's head that state a number and link no file or place that holds it."""
    head = page[page.index('<div class="opening">'):page.index("<nav>")]
    sentences = [html.unescape(one) for one in re.findall(r"<(?:p|li)>(.*?)</(?:p|li)>", head, re.DOTALL)]
    assert sentences and all(re.fullmatch(r"[\w./#-]+", link) for link in re.findall(r'href="([^"]*)"', head))
    return [one for one in sentences if re.search(r"\d", one) and "<a href" not in one]
