"""Light as numbers: the AgX tone curve, black bodies, exposure brackets and scale factors."""
