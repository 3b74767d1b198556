"""The ids of the groups of an SVG, by which tests find the layers of a figure."""

from __future__ import annotations

from xml.etree import ElementTree


def ids_in(svg: str) -> set[str]:
    """Return the ids of the elements of an SVG."""
    return {element.attrib["id"] for element in ElementTree.fromstring(svg).iter() if "id" in element.attrib}
