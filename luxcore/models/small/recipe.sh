#!/bin/sh
# The shipped weights from nothing: `make weights`. A killed run goes on where it stopped.
# Light falls smoothly, so networks learn most at 48 px, where steps are cheap, and end at 64 px.
set -eu
out="$1"
weights=luxcore/models/weights

train() { # NAME KIND OPTIONS...
    name="$1" kind="$2"
    shift 2
    python -m luxcore.models.small.train "$kind" --data "$out/rooms/train" --out "$out/$name" \
        --rooms 300 "$@"
}

install_weights() { cp "$out/$1/model.safetensors" "$weights/$2.safetensors"; }

python -m luxcore.models.small.rooms --out "$out/rooms"
cp "$out/rooms/manifest.json" "$weights/data_manifest.json"

train geometry geometry --groups 3000 --sketches 0 --size 64 --photos 12 --steps 9000 --rate 2e-3
install_weights geometry geometry

train sv48 sv --groups 1200 --sketches 40 --size 48 --steps 12000 --rate 2e-3
train sv sv --base "$out/sv48/model.safetensors" --groups 1200 --sketches 40 --size 64 \
    --steps 5000 --rate 1.2e-3
install_weights sv sv

train mv48 mv --groups 700 --sketches 40 --size 48 --photos 4 --steps 6000 --rate 1.2e-3
train mv mv --base "$out/mv48/model.safetensors" --groups 700 --sketches 40 --size 64 \
    --photos 4 --steps 3000 --rate 1e-3
install_weights mv mv
