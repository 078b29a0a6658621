"""A file to a `Scene`: the order of sections (sections 2.3 and 2.4 of the format)."""

import mmap
import os

import numpy as np

from . import limits, sections
from .container import NO_CHUNK, NO_SCALE, Container, section_name
from .errors import StrivecError
from .scales import read_scale
from .scene import Provenance, Scene, SkippedSection, UnknownSection


def open(path, budget=None):
    """Reads the scene of the file at `path` with at most `budget` bytes of memory besides the file's pages;
    without a number, `limits.default_budget`.

    Raises OSError if the file cannot be read, and a StrivecError if it is refused.
    """
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        if os.fstat(descriptor).st_size == 0:  # an empty file cannot be mapped
            return read(b"", budget)
        return read(mmap.mmap(descriptor, 0, access=mmap.ACCESS_READ), budget)
    finally:
        os.close(descriptor)


def read(data, budget=None):
    """Reads the scene of a bytes-like object that holds a whole file. Raises a StrivecError if it is refused."""
    if budget is None:
        budget = limits.default_budget(len(data))
    with np.errstate(over="ignore", invalid="ignore"):  # numbers that overflow are refused
        return _read_scene(Container(data, limits.Budget(budget)))


def _read_scene(container):
    frame = sections.read_frame(container.require("FRAME"))
    rules = sections.read_rules(container.require("RULES"))

    skipped = []

    def ancillary(read_section, kind, *arguments, scale=NO_SCALE):
        """The contents of a section, or None if it is absent or cannot be used (section 1)."""
        try:
            payload = container.find(kind, scale)
            return None if payload is None else read_section(payload, *arguments)
        except StrivecError as error:
            skipped.append(SkippedSection(section_name(kind, scale, NO_CHUNK), error))
            return None

    provenance = ancillary(sections.read_provenance, "PROVENANCE") or Provenance()
    license = ancillary(sections.read_license, "LICENCE")
    quality = ancillary(sections.read_quality, "QUALITY", rules.scales)
    views = ancillary(sections.read_views, "VIEWS")
    decoder = sections.read_decoder(container.require("DECODER"))
    payload = container.find("OCCUPANCY")
    occupancy = None if payload is None else sections.read_occupancy(payload)

    scales, prefixes = [], {}
    for index in range(rules.scales):
        scales.append(read_scale(container, index, decoder.features))
        if index + 1 < rules.scales:
            ranks = sum(scale.matrix.shape[1] for scale in scales)
            prefix = ancillary(sections.read_prefix, "PREFIX", decoder.features, ranks, scale=index)
            if prefix is not None:
                prefixes[index] = prefix

    probes = ancillary(sections.read_probes, "PROBES", rules)
    cameras = ancillary(sections.read_cameras, "CAMERAS") or []
    thumbnail = ancillary(sections.read_thumbnail, "THUMBNAIL")
    notes = ancillary(sections.read_notes, "NOTES") or {}
    container.finish()
    unknown = _unknown_sections(container, skipped)
    return Scene(
        container.minor,
        frame,
        rules,
        provenance,
        license,
        quality,
        views,
        thumbnail,
        decoder,
        occupancy,
        scales,
        prefixes,
        probes,
        cameras,
        notes,
        unknown,
        skipped,
    )


def _unknown_sections(container, skipped):
    unknown = []
    for section in container.unknown:
        try:
            container.check_usable(section)
            container.budget.take(section.length, section.name)
        except StrivecError as error:
            skipped.append(SkippedSection(section.name, error))
            continue
        data = bytes(container.data[section.offset : section.end])
        number = section.decoded_length
        unknown.append(UnknownSection(section.kind, section.scale, section.chunk, section.codec, number, data))
    return unknown
