"""Model the bicycle in MuJoCo, from MuJoCo's default settings to exact contacts and exact rolling forces."""
