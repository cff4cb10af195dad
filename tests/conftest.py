"""The order of the tests where several processes share them (`make test`)."""


def pytest_collection_modifyitems(config, items):
    """Files with slow tests first, so that no long one begins when the others are done; a single process keeps the files' order."""
    if hasattr(config, "workerinput"):
        slow = {item.path for item in items if item.get_closest_marker("slow")}
        items.sort(key=lambda item: item.path not in slow)
