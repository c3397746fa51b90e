"""Random runs against an independent reference: is any run wrong whose verdict is `holds`?"""
