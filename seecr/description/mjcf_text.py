"""An MJCF as its author wrote it: elements and attributes, with included files in their place."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree as ET

from seecr.errors import RobotError


class MjcfText:
    """The XML of a robot's file, read when it is needed.

    Attributes:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def root(self) -> ET.Element:
        """The root, with the content of included files instead of ``<include>``."""
        return self._parsed(self.path)

    def _parsed(self, path: Path) -> ET.Element:
        parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
        try:
            root = ET.fromstring(path.read_bytes(), parser)
        except (ET.ParseError, OSError) as error:
            raise RobotError(f"{path}: cannot be read as XML: {error}") from None
        for parent in list(root.iter()):
            for child in [one for one in parent if one.tag == "include"]:
                inside = self._parsed(self._beside(path, child.get("file", "")))
                at = list(parent).index(child)
                parent.remove(child)
                for k, one in enumerate(inside):
                    parent.insert(at + k, one)
        return root

    def _beside(self, path: Path, name: str) -> Path:
        """An included file, which is named as seen from the main one."""
        main = self.path.parent / name
        return main if main.is_file() else path.parent / name

    @cached_property
    def tendons(self) -> list[ET.Element]:
        """The tendons, in MuJoCo's order."""
        sections = [one for one in self.root if one.tag == "tendon"]
        return [one for part in sections for one in part if one.tag in ("spatial", "fixed")]

    def attribute(self, i: int, name: str) -> str | None:
        """What is written for tendon i, itself or by its class; None without."""
        if i >= len(self.tendons):
            return None  # another file's, attached by MuJoCo
        tendon = self.tendons[i]
        if name in tendon.attrib:
            return tendon.get(name)
        return self._of_class(tendon.get("class"), name)

    def _of_class(self, wanted: str | None, name: str) -> str | None:
        """What the defaults of a class say, or of the classes that it is in."""
        parents = {child: parent for parent in self.root.iter() for child in parent}
        tops = [one for one in self.root if one.tag == "default"]
        every = [one for top in tops for one in top.iter("default")]
        some = [one for one in every if one.get("class") == wanted] if wanted else tops
        for one in some:
            while one.tag == "default":
                for own in one.findall("tendon"):
                    if name in own.attrib:
                        return own.get(name)
                one = parents[one]
        return None
