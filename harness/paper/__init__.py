"""The paper's figures and claims computed anew, each with a verdict; imports `pages`."""
