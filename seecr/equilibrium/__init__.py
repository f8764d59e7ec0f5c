"""Where the platform comes to rest: one pose, all of them, and the ways between them."""
