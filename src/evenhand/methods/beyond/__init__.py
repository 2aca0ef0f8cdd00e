"""Ways to guide a policy that the paper does not have: one file a method."""
