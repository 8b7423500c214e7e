"""Models judged on readings that nothing was fitted to; what each effect gains there."""
