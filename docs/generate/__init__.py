"""What generates the site's pages: a module for each kind, from code and from what git holds."""
