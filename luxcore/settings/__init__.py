"""What `params.yaml` may say: one frozen, validated section per stage."""
