"""All steps by one command: from files of sensors to motion, tables and a report, gone on with where it stopped."""
