"""What lint claims of random models, against runs that try to contradict it; see `claims`."""

import pytest
from lint.claims import Attack


@pytest.mark.parametrize("seed", [0, 1, 3, 6, 11, 12, 15, 31, 41, 63, 330, 412, 577, 625, 838])
def test_no_run_contradicts_a_claim(seed):
    assert Attack(seed).all().wrong == []


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(10))
def test_no_run_of_a_long_campaign_contradicts_a_claim(part):
    attacks = [Attack(seed).all() for seed in range(100 * part, 100 * part + 100)]
    assert [wrong for attack in attacks for wrong in attack.wrong] == []
    assert all(sum(attack.tried[code] for attack in attacks) for code in ("HS501", "HS505", "HS506", "HS508"))
