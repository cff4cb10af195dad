"""A press in a browser: what is pressed (`state`), its maps (`solver`), pictures, files, long models, and the page (viser)."""
