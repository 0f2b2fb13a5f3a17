"""Other systems that hear a site: an MQTT broker, Home Assistant, receivers of webhooks."""
