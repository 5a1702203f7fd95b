"""The paper: the numbers it prints, and its experiments repeated; a folder for each chapter of the report."""
