"""Every numeric option has its limits in one table, and what lies outside is refused in a sentence."""

import math

import pytest

from eaid.errors import UsageError
from eaid.limits import LIMITS, check, check_all, fault


@pytest.mark.parametrize("name", LIMITS)
def test_the_ends_are_within_and_what_is_no_number_is_not(name: str) -> None:
    limit = LIMITS[name]
    check(name, limit.most)
    assert (fault(name, limit.least) is None) is not limit.above
    for value in (math.nan, math.inf, -math.inf, math.nextafter(limit.most, math.inf), limit.least - 1):
        assert fault(name, value) is not None
    if limit.whole:
        assert fault(name, limit.least + 0.5) is not None


def test_the_sentence_names_option_value_and_range() -> None:
    with pytest.raises(UsageError) as told:
        check("seed", -1)
    assert told.value.sentences == ("«seed» -1: give a whole number from 0 to 9007199254740991",)
    with pytest.raises(UsageError) as told:
        check_all(epsilon=0.0, gamma=None, phi=1e308, kp=2.0)
    assert told.value.sentences == (
        "«epsilon» 0: give a number from 1e-15 to 1e+15",
        "«phi» 1e+308: give a number from 0 to 1e+09",
    )
    assert len(fault("seed", 10**400) or "") < 120
