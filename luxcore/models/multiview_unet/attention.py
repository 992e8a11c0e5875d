"""Self-attention over the tokens of all views of a scene, in a U-Net made for single pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional

if TYPE_CHECKING:
    from diffusers import UNet2DConditionModel
    from diffusers.models.attention_processor import Attention


class ViewAttention:
    """Attention processor; `joint` makes self-attention span the views.

    Views ride in the batch dimension, [scenes · views, tokens, channels]. A view that is not
    `present` is padding: no present view attends to it, so its content changes no bit of them.
    """

    def __init__(self, joint: bool) -> None:
        self.joint = joint

    def __call__(
        self,
        attn: Attention,
        hidden_states: Float[Tensor, "bv n c"],
        encoder_hidden_states: Float[Tensor, "bv t d"] | None = None,
        attention_mask: Tensor | None = None,
        temb: Tensor | None = None,
        present: Bool[Tensor, "b v"] | None = None,
    ) -> Float[Tensor, "bv n c"]:
        tokens = hidden_states.shape[1]
        spans = self.joint and encoder_hidden_states is None and present is not None
        mask = None
        if spans:
            views = present.shape[1]  # type: ignore[union-attr]
            hidden_states = hidden_states.unflatten(0, (-1, views)).flatten(1, 2)  # [b, v·n, c]
            mask = _key_mask(present, tokens)  # type: ignore[arg-type]
        context = hidden_states if encoder_hidden_states is None else encoder_hidden_states
        mixed = _attend(attn, hidden_states, context, mask)
        if spans:
            mixed = mixed.unflatten(1, (views, tokens)).flatten(0, 1)
        return attn.to_out[1](attn.to_out[0](mixed))


def attend_across_views(unet: UNet2DConditionModel, joint_channels_min: int) -> None:
    """Install ViewAttention everywhere; it spans the views where self-attention is that wide."""
    processors = {}
    for name in unet.attn_processors:
        layer = unet.get_submodule(name.removesuffix(".processor"))
        is_self = layer.to_q.in_features == layer.to_k.in_features and ".attn1." in name
        processors[name] = ViewAttention(is_self and layer.to_q.in_features >= joint_channels_min)
    unet.set_attn_processor(processors)


def _key_mask(present: Bool[Tensor, "b v"], tokens: int) -> Bool[Tensor, "b 1 1 vn"] | None:
    if bool(present.all()):
        return None
    return present.repeat_interleave(tokens, dim=1)[:, None, None, :]


def _attend(
    attn: Attention,
    queries: Float[Tensor, "b q c"],
    context: Float[Tensor, "b k d"],
    mask: Bool[Tensor, "b 1 1 k"] | None,
) -> Float[Tensor, "b q c"]:
    query, key, value = (
        _heads(layer(tokens), attn.heads)
        for layer, tokens in ((attn.to_q, queries), (attn.to_k, context), (attn.to_v, context))
    )
    if attn.upcast_attention:
        # Stable Diffusion 2.1's logits overflow half precision.
        query, key, value = query.float(), key.float(), value.float()
    mixed = functional.scaled_dot_product_attention(query, key, value, attn_mask=mask)
    return mixed.transpose(1, 2).flatten(2).to(queries.dtype)


def _heads(tokens: Float[Tensor, "b n c"], heads: int) -> Float[Tensor, "b heads n d"]:
    return tokens.unflatten(-1, (heads, -1)).transpose(1, 2)
