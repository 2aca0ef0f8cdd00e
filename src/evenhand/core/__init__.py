"""What every part needs: errors, files, text, processes. It knows nothing of robots."""
