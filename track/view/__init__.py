"""What people look at: charts, pictures of fits."""
