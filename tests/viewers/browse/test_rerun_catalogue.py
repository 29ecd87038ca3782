"""A session by Rerun's own catalogue server: what it holds, and links to moments."""

import sys
import urllib.request
from pathlib import Path
from urllib.parse import unquote

import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs"))
from example_folder import fill

from tacdata.errors import UsageError
from tacdata.viewers.browse.catalogue import Catalogue, catalogue_server
from tacdata.viewers.browse.list_sources import episodes_at


@pytest.fixture(scope="module")
def listed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("catalogue")
    fill(folder)
    return episodes_at(folder / "session")


def asked(address):
    """Return what a catalogue answers on its entries: gRPC over HTTP, in which names stand as plain text."""
    request = urllib.request.Request(
        f"{address.removeprefix('rerun+')}/rerun.cloud.v1alpha1.RerunCloudService/FindEntries",
        data=b"\0\0\0\0\0",
        method="POST",
        headers={"Content-Type": "application/grpc-web+proto", "X-Grpc-Web": "1"},
    )
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read().decode("latin-1")


def test_a_session_is_served_as_one_dataset_with_a_recording_an_episode(listed):
    told = []
    with catalogue_server(listed, None, None, lambda *count: told.append(count)) as served:
        assert "session" in asked(served.address)
        assert served.address.startswith("rerun+http://127.0.0.1:"), "nobody else is answered"
        with urllib.request.urlopen(served.whole, timeout=60) as page:
            assert page.status == 200
    assert told == [(1, 2), (2, 2)]
    with pytest.raises(OSError):
        asked(served.address)


def test_an_episode_s_link_says_its_deepest_moment():
    served = Catalogue("http://h:1", "rerun+http://h:2", "rerun+http://h:2/dataset/ab", {7: 1_760_000_003_501_054_941})
    link = unquote(served.at_deepest(7))
    assert link.endswith("/dataset/ab?segment_id=episode-000007#when=host_time@2025-10-09T08:53:23.501054941Z")
    assert Catalogue("http://h:1", "rerun+http://h:2", "", {7: 0}).at_deepest(7) == ""


def test_rerun_s_client_finds_our_layout_and_every_recording(listed):
    pytest.importorskip("datafusion", reason="rerun-sdk[catalog] is not installed")
    from rerun.catalog import CatalogClient

    with catalogue_server(listed, None, None, lambda *_: None) as served:
        dataset = CatalogClient(served.address).get_dataset("session")
        assert served.dataset.endswith(str(dataset.id))
        assert sorted(dataset.segment_ids()) == ["episode-000000", "episode-000001"]
        assert dataset.default_blueprint() and len(dataset.blueprints()) == 1


def test_an_empty_list_is_refused(listed):
    with pytest.raises(UsageError, match="no episode"), catalogue_server(listed.where("depth>9"), None, None, print):
        pass
