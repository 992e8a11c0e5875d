"""The U-Net: what its parts may see of each other."""

from __future__ import annotations

import torch

from luxcore.models.small.network import AmongLamps, LampNet, NetworkShape
from luxcore.models.small.weights import CHANNELS
from tests.models.sketched import TINY

LAMPS, SIZE = 5, 32
PHOTO = torch.tensor([0, 0, 1, 1, 1])


def awake(together: int) -> LampNet:
    """A network whose attention among lamps says something (new ones start silent)."""
    torch.manual_seed(0)
    net = LampNet(NetworkShape(*CHANNELS["sv"], TINY, together=together))
    for part in (*(m.out for m in net.modules() if isinstance(m, AmongLamps)), net.head):
        torch.nn.init.normal_(part.weight, std=0.3)
    return net.eval()


def features() -> torch.Tensor:
    return torch.rand(
        LAMPS, CHANNELS["sv"][0], SIZE, SIZE, generator=torch.Generator().manual_seed(1)
    )


def test_lamps_see_those_of_their_own_photo_only() -> None:
    net, asked = awake(together=2), features()
    changed = asked.clone()
    changed[4] = changed[4].flip(-1)
    with torch.no_grad():
        both, other = net(asked, PHOTO), net(changed, PHOTO)
        alone = torch.cat([net(asked[:2]), net(asked[2:])])
    torch.testing.assert_close(both, alone, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(both[:2], other[:2], rtol=1e-4, atol=1e-5)
    assert (both[2] - other[2]).abs().max() > 1e-3


def test_the_order_of_lamps_does_not_matter() -> None:
    net, asked = awake(together=2), features()
    order = torch.tensor([3, 0, 4, 1, 2])
    with torch.no_grad():
        torch.testing.assert_close(net(asked)[order], net(asked[order]), rtol=1e-4, atol=1e-5)


def test_a_new_network_starts_as_the_one_without_attention_among_lamps() -> None:
    torch.manual_seed(0)
    plain = LampNet(NetworkShape(*CHANNELS["sv"], TINY)).eval()
    torch.nn.init.normal_(plain.head.weight, std=0.3)
    wide = LampNet(NetworkShape(*CHANNELS["sv"], TINY, together=2)).eval()
    wide.load_state_dict(plain.state_dict(), strict=False)
    with torch.no_grad():
        torch.testing.assert_close(wide(features()), plain(features()), rtol=0, atol=0)
