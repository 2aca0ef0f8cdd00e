"""Controls: what explains more even service without any fairness."""
