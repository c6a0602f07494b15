"""The method of Dream Fields as pure functions: values in, values out. No path is opened here and no Prefect is imported."""
