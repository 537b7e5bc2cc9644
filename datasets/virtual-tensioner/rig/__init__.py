"""A chain tensioner in small finite elements: the virtual rig. Shares no code and no formulation with the product's engines."""
