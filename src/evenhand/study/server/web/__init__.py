"""The study on the web: pages and requests of participants, and the lead's dashboard."""
