"""A press that is solved in this process."""

from types import SimpleNamespace

from threadpoolctl import threadpool_info

import tacdata as td


def test_a_press_uses_one_thread(monkeypatch):
    pools = []
    model = SimpleNamespace(solve=lambda request: pools.extend(threadpool_info()))
    skin = td.Skin()
    monkeypatch.setitem(vars(skin), "model", model)
    skin.solve(td.Press(td.indenter("sphere", radius=4.0), depth=0.4))
    assert pools and {pool["num_threads"] for pool in pools} == {1}
