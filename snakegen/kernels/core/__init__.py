"""The compiler decorator, stack arrays and small linear algebra."""
