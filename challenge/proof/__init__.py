"""The proof's page: scoreboard, tables, pictures, record of test runs."""
