"""The response of a packing when two grains in contact are pushed apart."""
