#!/bin/sh
# The shipped weights from nothing: `make weights`. A killed run goes on where it stopped.
# Each network is trained at 64 px first, where steps are cheap, and ends at 96 px.
set -eu
out="$1"
weights=luxcore/models/weights

train() { # NAME KIND OPTIONS...
    name="$1" kind="$2"
    shift 2
    python -m luxcore.models.small.train "$kind" --data "$out/rooms/train" --out "$out/$name" "$@"
}

install_weights() { cp "$out/$1/model.safetensors" "$weights/$2.safetensors"; }

python -m luxcore.models.small.rooms --out "$out/rooms"
cp "$out/rooms/manifest.json" "$weights/data_manifest.json"

train geometry64 geometry --rooms 100 --groups 280 --sketches 0 --size 64 --photos 12 --steps 2400
install_weights geometry64 geometry
train sv64 sv --rooms 130 --groups 390 --sketches 60 --size 64 --steps 4500

train geometry geometry --base "$out/geometry64/model.safetensors" --rooms 100 --groups 280 \
    --sketches 0 --photos 12 --steps 800 --rate 1e-3
install_weights geometry geometry
train sv sv --base "$out/sv64/model.safetensors" --rooms 230 --groups 900 --sketches 60 \
    --steps 900 --rate 1e-3
train sv240 sv --base "$out/sv/model.safetensors" --rooms 240 --groups 1400 --sketches 40 \
    --steps 2600 --rate 8e-4
install_weights sv240 sv

train mv mv --rooms 130 --groups 160 --sketches 40 --size 64 --photos 4 --steps 1000 --rate 1e-3
install_weights mv mv
