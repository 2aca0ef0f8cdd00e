"""What happened, how even it is, and what evenness is worth. No simulator, no JAX."""
