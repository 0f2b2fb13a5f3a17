"""The tree stays readable: bounds on folders, names, docstrings and documents."""

from __future__ import annotations

import pytest

from conventions import (
    PRODUCT,
    docstrings_beginning_with,
    flat_folders,
    missing_sources_in_documents,
    rooms,
    shared_class_names,
    words_of,
)
from docstring_names import stale_names

MAX_FILES_PER_FOLDER = 20
MAX_LINES_PER_MODULE = 350
MAX_WORDS = {"README.md": 700, "docs": 25_000}


def test_no_folder_has_too_many_files() -> None:
    assert flat_folders(MAX_FILES_PER_FOLDER) == {}


def test_no_module_of_the_product_is_too_long() -> None:
    product = [room for room in rooms() if room.name.split("/")[0] in PRODUCT]
    assert {room.largest_file: room.largest for room in product if room.largest > MAX_LINES_PER_MODULE} == {}


def test_no_two_public_classes_of_a_package_share_a_name() -> None:
    assert shared_class_names() == {}


def test_docstrings_begin_with_plain_verbs() -> None:
    assert docstrings_beginning_with(("Give", "Tell", "Say"), ".") == []


def test_names_in_docstrings_exist() -> None:
    assert stale_names() == []


def test_modules_in_documents_exist() -> None:
    assert missing_sources_in_documents() == []


@pytest.mark.parametrize("document", MAX_WORDS)
def test_documents_are_short(document: str) -> None:
    assert words_of(document) <= MAX_WORDS[document]
