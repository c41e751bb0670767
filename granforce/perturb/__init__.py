"""What a packing does when two grains in contact are pushed apart."""
