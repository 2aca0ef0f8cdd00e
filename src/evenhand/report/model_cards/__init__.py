"""Model cards in the manner of Hugging Face: what is known of a robot or a detector."""
